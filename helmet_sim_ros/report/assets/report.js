/* Draws each impact when it comes into view; colours; printing. */
"use strict";
(() => {
  const root = document.documentElement;
  const waiting = new Map();  // element -> draws it

  function drawn(element) {
    const draw = waiting.get(element);
    waiting.delete(element);
    if (!draw) return Promise.resolve();
    return draw().catch((error) => {
      const said = document.createElement("p");
      said.className = "problem";
      said.textContent = `The plots of this part cannot be drawn: ${error.message}`;
      element.append(said);
    });
  }

  const block = (element) => page.decoded(element.querySelector("script[data-block]").textContent);
  const charts = (element, specs, key) =>
    element.querySelectorAll(".chart").forEach((figure) => page.chart(figure, specs[figure.dataset.chart], key));

  /* Rows of meaning, value, unit, window or time, limit, verdict, note and name. */
  function criteria(body, rows) {
    for (const cells of rows) {
      const row = body.insertRow(), name = document.createElement("th");
      name.scope = "row";
      name.textContent = cells[0];
      name.title = cells[7];
      row.append(name);
      cells.slice(1, 7).forEach((text) => { row.insertCell().textContent = text; });
      row.cells[5].className = cells[5];
    }
  }

  document.querySelectorAll("article.impact").forEach((article) => waiting.set(article, async () => {
    const data = await block(article), histories = page.histories(data);
    charts(article, histories, article.id);
    criteria(article.querySelector("[data-criteria]"), data.criteria);
    const figure = article.querySelector(".replay");
    if (figure) page.replay(figure, data, histories);
    article.dataset.drawn = "true";
  }));
  document.querySelectorAll(".comparison").forEach((part) => waiting.set(part, async () => {
    charts(part, page.overlaid(await block(part)), part.id);
    part.dataset.drawn = "true";
  }));

  const observer = new IntersectionObserver((entries) => entries.filter((e) => e.isIntersecting).forEach((entry) => {
    observer.unobserve(entry.target);
    drawn(entry.target);
  }), { rootMargin: "800px" });
  [...waiting.keys()].forEach((element) => observer.observe(element));

  /* Everything, for paper; a few impacts are drawn anyway, so that any way of printing has them. */
  const FEW = 12;
  const all = async () => {
    for (const element of [...waiting.keys()]) await drawn(element);
    root.dataset.drawn = "all";
  };
  const idle = window.requestIdleCallback || ((act) => setTimeout(act, 200));
  if (waiting.size <= FEW) idle(all);

  const redraw = () => page.redraws.forEach((again) => again());
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  const dark = () => (root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches);
  document.querySelector("[data-act=theme]").addEventListener("click", () => {
    root.dataset.theme = dark() ? "light" : "dark";
    redraw();
  });
  document.querySelector("[data-act=print]").addEventListener("click", async (event) => {
    event.target.disabled = true;
    await all();
    event.target.disabled = false;
    print();
  });
  let theme;
  addEventListener("beforeprint", () => {
    theme = root.dataset.theme;
    root.dataset.theme = "light";
    root.dataset.printing = "true";
    redraw();
  });
  addEventListener("afterprint", () => {
    delete root.dataset.printing;
    if (theme === undefined) delete root.dataset.theme;
    else root.dataset.theme = theme;
    redraw();
  });
  root.dataset.ready = "true";
})();
