/* Plots and replay of the report; everything it draws is in this file. */
"use strict";
(() => {
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const floats = (text) => {
    const raw = atob(text), bytes = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
    return new Float32Array(bytes.buffer);
  };
  const length3 = (x, y, z) => x.map((_, i) => Math.hypot(x[i], y[i], z[i]));
  const EDGE = "#4a4038";  // outline of bodies, on light and dark ground
  const redraws = [];  // called when colours or sizes change

  /* ---- histories -------------------------------------------------------------------- */

  function histories(data) {
    const a = {}, time = new Float64Array(data.count);
    for (const name in data.arrays) a[name] = floats(data.arrays[name]);
    for (let i = 0; i < time.length; i++) time[i] = data.start + i * data.step;
    return {
      acceleration: {
        unit: "g", time, window: data.window, limits: data.limits.acceleration, marks: data.marks.acceleration,
        series: [
          ["resultant", length3(a.ax, a.ay, a.az), "--c1", 2], ["resultant, CFC 1000", a.cfc, "--c2", 1.5],
          ["x", a.ax, "--c3", 1], ["y", a.ay, "--c4", 1], ["z", a.az, "--c5", 1],
        ].filter((s) => s[1] && s[1].length),
      },
      force: {
        unit: "kN", time, limits: [], marks: data.marks.force,
        series: [["ground, normal", a.fn, "--c1", 2], ["ground, tangential", a.ft, "--c2", 1.5],
                 ["helmet on head", a.fc, "--c3", 1.5]],
      },
      compression: {
        unit: "mm", time, limits: data.limits.compression, marks: data.marks.compression,
        series: [["resultant", length3(a.dx, a.dy, a.dz), "--c1", 2], ["x", a.dx, "--c3", 1.2],
                 ["y", a.dy, "--c4", 1.2], ["z", a.dz, "--c5", 1.2]],
      },
    };
  }

  function shade(u, range) {
    if (!range) return;
    const x0 = Math.max(u.valToPos(range[0], "x", true), u.bbox.left);
    const x1 = Math.min(u.valToPos(range[1], "x", true), u.bbox.left + u.bbox.width);
    if (x1 <= x0) return;
    u.ctx.fillStyle = css("--window");
    u.ctx.fillRect(x0, u.bbox.top, x1 - x0, u.bbox.height);
    write(u, "HIC window", x0 + 4, u.bbox.top + u.bbox.height - 6, css("--muted"));
  }

  function write(u, text, x, y, color, align) {
    const { ctx } = u;
    ctx.save();
    ctx.fillStyle = color;
    ctx.textAlign = align || "left";
    ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
    ctx.fillText(text, x, y);
    ctx.restore();
  }

  function annotate(u, spec) {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    for (const limit of spec.limits) {
      const y = u.valToPos(limit.value, "y", true), inside = y >= bbox.top;
      if (inside) {
        ctx.strokeStyle = css("--fail");
        ctx.setLineDash([6, 4]);
        ctx.beginPath();
        ctx.moveTo(bbox.left, y);
        ctx.lineTo(bbox.left + bbox.width, y);
        ctx.stroke();
        ctx.setLineDash([]);
      }
      const at = inside && y > bbox.top + 18 * devicePixelRatio ? y - 5 : Math.max(y, bbox.top) + 14 * devicePixelRatio;
      write(u, inside ? limit.label : `${limit.label}, above this plot`, bbox.left + bbox.width - 6, at, css("--fail"), "right");
    }
    const taken = [];  // where labels stand already
    for (const mark of spec.marks) {
      const index = spec.series.findIndex((s) => s[0] === mark.series);
      if (index < 0 || !u.series[index + 1].show) continue;
      const x = u.valToPos(mark.time, "x", true), y = u.valToPos(mark.value, "y", true);
      ctx.fillStyle = css(spec.series[index][2]);
      ctx.beginPath();
      ctx.arc(x, y, 4 * devicePixelRatio, 0, 2 * Math.PI);
      ctx.fill();
      const line = 13 * devicePixelRatio;
      let at = Math.max(y, bbox.top + line);
      while (taken.some(([left, top]) => Math.abs(left - x) < 8 * line && Math.abs(top - at) < line)) at += line;
      taken.push([x, at]);
      write(u, mark.label, x + 7 * devicePixelRatio, at, css("--fg"));
    }
    ctx.restore();
  }

  function yRange(spec) {
    return (u, low, high) => {
      let top = high + 0.08 * (high - low);
      for (const limit of spec.limits) {
        if (high > 0.45 * limit.value && limit.value > high) top = Math.max(top, 1.06 * limit.value);
      }
      return [low < 0 ? low - 0.06 * (high - low) : 0, top > low ? top : low + 1];
    };
  }

  const PAPER = 690;  // pixel, inside the margins of A4 and Letter
  const plotWidth = (host) => (document.documentElement.dataset.theme ? PAPER : Math.max(260, host.clientWidth));

  function draw(host, spec, key, shown) {
    const axis = { stroke: css("--fg"), grid: { stroke: css("--line"), width: 1 }, ticks: { stroke: css("--line") } };
    const options = {
      width: plotWidth(host), height: host.clientWidth < 500 ? 240 : 280,
      scales: { x: { time: false }, y: { range: yRange(spec) } },
      axes: [{ ...axis, label: "time [ms]" }, { ...axis, label: spec.unit, size: 58 }],
      cursor: { sync: { key }, drag: { x: true, y: false } },
      series: [
        { label: "time [ms]", value: (u, v) => (v == null ? "" : v.toFixed(2)) },
        ...spec.series.map(([label, , color, width], i) => ({
          label, width, stroke: css(color), show: shown[i], points: { show: false },
          value: (u, v) => (v == null ? "" : v.toFixed(v < 10 ? 2 : 1)),
        })),
      ],
      hooks: {
        drawAxes: [(u) => shade(u, spec.window)],
        draw: [(u) => annotate(u, spec)],
        setSeries: [(u) => u.series.slice(1).forEach((s, i) => {
          shown[i] = s.show;
          pressed(u, i, s.show);
        })],
        setScale: [(u, scale) => {
          if (scale !== "x") return;
          const { min, max } = u.scales.x, t = spec.time;
          host.parentElement.querySelector(".reset").hidden = min <= t[0] && max >= t[t.length - 1];
        }],
      },
    };
    const plot = new uPlot(options, [spec.time, ...spec.series.map((s) => s[1])], host);
    plot.root.querySelectorAll(".u-legend .u-series").forEach((row, i) => {
      if (!i) return;
      const name = row.querySelector("th");
      name.tabIndex = 0;
      name.setAttribute("role", "button");
      name.addEventListener("keydown", (event) => {
        if (event.key !== "Enter" && event.key !== " ") return;
        event.preventDefault();
        event.stopPropagation();
        name.click();
      });
      pressed(plot, i - 1, shown[i - 1]);
    });
    return plot;
  }

  function pressed(plot, i, on) {
    const row = plot.root.querySelectorAll(".u-legend .u-series")[i + 1];
    if (row) row.querySelector("th").setAttribute("aria-pressed", String(on));
  }

  function chart(figure, spec, key) {
    const host = figure.querySelector(".plot"), shown = spec.series.map((s) => !["x", "y", "z"].includes(s[0]) || spec.unit === "mm");
    let plot = draw(host, spec, key, shown), width = host.clientWidth;
    const renew = () => {
      const { min, max } = plot.scales.x;
      plot.destroy();
      plot = draw(host, spec, key, shown);
      plot.setScale("x", { min, max });
    };
    const all = () => plot.setScale("x", { min: spec.time[0], max: spec.time[spec.time.length - 1] });
    redraws.push(renew);
    figure.querySelector(".reset").addEventListener("click", all);
    host.addEventListener("keydown", (event) => {
      const { min, max } = plot.scales.x, step = (max - min) / 200, middle = (min + max) / 2;
      const move = (by) => {
        const now = plot.cursor.left >= 0 ? plot.posToVal(plot.cursor.left, "x") : middle;
        const left = plot.valToPos(Math.min(max, Math.max(min, now + by)), "x");
        plot.setCursor({ left, top: plot.over.clientHeight / 2 });
      };
      const zoom = (by) => {
        const now = plot.cursor.left >= 0 ? plot.posToVal(plot.cursor.left, "x") : middle, half = ((max - min) / 2) * by;
        if (half * 2 >= spec.time[spec.time.length - 1] - spec.time[0]) all();
        else plot.setScale("x", { min: Math.max(spec.time[0], now - half), max: Math.min(spec.time[spec.time.length - 1], now + half) });
      };
      const act = {
        ArrowLeft: () => move(-step), ArrowRight: () => move(step), "+": () => zoom(0.5), "=": () => zoom(0.5),
        "-": () => zoom(2), 0: all, Escape: all,
      }[event.key];
      if (act) { event.preventDefault(); act(); }
    });
    new ResizeObserver(() => {
      if (host.clientWidth && host.clientWidth !== width && !document.documentElement.dataset.theme) {
        width = host.clientWidth;
        plot.setSize({ width: plotWidth(host), height: plot.height });
      }
    }).observe(host);
  }

  /* ---- replay ------------------------------------------------------------------------- */

  /* Parallel projection, in which an ellipsoid is exactly an ellipse and a capsule a thick line. */
  function replay(figure, data, history) {
    const canvas = figure.querySelector("canvas"), ctx = canvas.getContext("2d");
    const time = floats(data.time), poses = floats(data.poses), arrows = floats(data.arrows);
    const count = time.length, bodies = data.shapes.length, slider = figure.querySelector("input");
    const control = (name) => figure.querySelector(`[data-act=${name}]`);
    const head = data.shapes.findIndex((s) => s.name === "head");
    const force = history.force.series[0][1];
    let peak = 0;
    for (let f = 0; f < count; f++) if (at(force, time[f]) > at(force, time[peak])) peak = f;
    const state = { frame: peak, azimuth: -0.9, elevation: 0.22, zoom: false, playing: false };
    slider.max = count - 1;

    function at(values, t) {
      const i = Math.round((t - history.force.time[0]) / (history.force.time[1] - history.force.time[0]));
      return values[Math.min(values.length - 1, Math.max(0, i))];
    }

    function axes() {
      const [ca, sa, ce, se] = [Math.cos(state.azimuth), Math.sin(state.azimuth), Math.cos(state.elevation), Math.sin(state.elevation)];
      return { right: [-sa, ca, 0], up: [-se * ca, -se * sa, ce], near: [ce * ca, ce * sa, se] };
    }
    const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    function matrix(q) {
      const [x, y, z, w] = q;
      return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
      ];
    }
    const column = (m, i) => [m[0][i], m[1][i], m[2][i]];

    function frame(view) {  // centre and scale [pixel per metre] that show all shapes, or the helmet
      const width = canvas.clientWidth, height = canvas.clientHeight, from = state.frame * bodies * 7;
      if (state.zoom && head >= 0) {
        const o = from + head * 7, p = [poses[o], poses[o + 1], 0.5 * poses[o + 2] + 0.1];
        return { scale: Math.min(width, height) / 0.75, x: dot(p, view.right), y: dot(p, view.up) };
      }
      let [x0, x1, y0, y1] = [Infinity, -Infinity, Infinity, -Infinity];
      for (let b = 0; b < bodies; b++) {
        const p = poses.subarray(b * 7, b * 7 + 3), x = dot(p, view.right), y = dot(p, view.up), r = 0.25;
        x0 = Math.min(x0, x - r); x1 = Math.max(x1, x + r); y0 = Math.min(y0, y - r); y1 = Math.max(y1, y + r);
      }
      return { scale: 0.95 * Math.min(width / (x1 - x0), height / (y1 - y0)), x: (x0 + x1) / 2, y: (y0 + y1) / 2 };
    }

    function paint() {
      const ratio = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
      if (!width) return;
      canvas.width = width * ratio;
      canvas.height = height * ratio;
      ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
      const view = axes(), { scale, x, y } = frame(view);
      const place = (p) => [width / 2 + (dot(p, view.right) - x) * scale, height / 2 - (dot(p, view.up) - y) * scale];
      ground(place);
      const order = [...data.shapes.keys()].map((b) => {
        const o = (state.frame * bodies + b) * 7;
        return { b, p: [...poses.subarray(o, o + 3)], m: matrix(poses.subarray(o + 3, o + 7)) };
      });
      order.sort((one, two) => dot(one.p, view.near) - dot(two.p, view.near));
      for (const { b, p, m } of order) body(data.shapes[b], p, m, view, place, scale);
      data.names.forEach((name, i) => arrow(name, i, place));
      slider.value = state.frame;
      const t = time[state.frame];
      control("text").textContent = `${t.toFixed(2)} ms · ${at(history.acceleration.series[0][1], t).toFixed(0)} g · ` +
        `normal ${at(force, t).toFixed(2)} kN · tangential ${at(history.force.series[1][1], t).toFixed(2)} kN`;
    }

    function ground(place) {
      const o = Math.max(head, 0) * 7, cx = Math.round(poses[o] * 4) / 4, cy = Math.round(poses[o + 1] * 4) / 4;
      ctx.strokeStyle = css("--line");
      ctx.lineWidth = 1;
      ctx.fillStyle = css("--ground");
      ctx.beginPath();
      [[-2, -2], [2, -2], [2, 2], [-2, 2]].forEach(([dx, dy]) => ctx.lineTo(...place([cx + dx, cy + dy, 0])));
      ctx.fill();
      ctx.beginPath();
      for (let d = -2; d <= 2; d += 0.25) {
        ctx.moveTo(...place([cx + d, cy - 2, 0])); ctx.lineTo(...place([cx + d, cy + 2, 0]));
        ctx.moveTo(...place([cx - 2, cy + d, 0])); ctx.lineTo(...place([cx + 2, cy + d, 0]));
      }
      ctx.stroke();
    }

    function body(shape, p, m, view, place, scale) {
      const [px, py] = place(p);
      ctx.lineCap = "round";
      if (shape.kind === "capsule") {
        const axis = column(m, 2), half = shape.size[1];
        const ends = [-half, half].map((h) => place(p.map((v, i) => v + h * axis[i])));
        for (const [width, color] of [[2 * shape.size[0] * scale, EDGE], [2 * shape.size[0] * scale - 2, shape.color]]) {
          ctx.strokeStyle = color;
          ctx.lineWidth = Math.max(1, width);
          ctx.beginPath();
          ctx.moveTo(...ends[0]);
          ctx.lineTo(...ends[1]);
          ctx.stroke();
        }
        return;
      }
      const r = [0, 1, 2].map((i) => shape.size[i] * dot(column(m, i), view.right));
      const u = [0, 1, 2].map((i) => shape.size[i] * dot(column(m, i), view.up));
      const [a, b, c] = [dot(r, r), dot(r, u), dot(u, u)];
      const mean = (a + c) / 2, spread = Math.hypot((a - c) / 2, b), angle = 0.5 * Math.atan2(2 * b, a - c);
      ctx.beginPath();
      ctx.ellipse(px, py, Math.sqrt(mean + spread) * scale, Math.sqrt(Math.max(0, mean - spread)) * scale, -angle, 0, 2 * Math.PI);
      ctx.fillStyle = shape.color;
      ctx.fill();
      ctx.strokeStyle = EDGE;
      ctx.lineWidth = 1;
      ctx.stroke();
    }

    function arrow(name, i, place) {
      const o = (state.frame * data.names.length + i) * 6;
      const tail = place(arrows.subarray(o, o + 3)), whole = place(arrows.subarray(o + 3, o + 6));
      const tip = whole.map((v, k) => tail[k] + (state.zoom ? 0.4 : 1) * (v - tail[k]));  // to fit the view
      const dx = tip[0] - tail[0], dy = tip[1] - tail[1], long = Math.hypot(dx, dy);
      if (long < 3) return;
      const [ux, uy] = [dx / long, dy / long], size = Math.min(12, long);
      ctx.strokeStyle = ctx.fillStyle = data.arrowColors[i];
      ctx.lineWidth = 4;
      ctx.lineCap = "butt";
      ctx.beginPath();
      ctx.moveTo(...tail);
      ctx.lineTo(tip[0] - ux * size, tip[1] - uy * size);
      ctx.stroke();
      ctx.beginPath();
      ctx.moveTo(...tip);
      ctx.lineTo(tip[0] - ux * size - uy * size * 0.6, tip[1] - uy * size + ux * size * 0.6);
      ctx.lineTo(tip[0] - ux * size + uy * size * 0.6, tip[1] - uy * size - ux * size * 0.6);
      ctx.fill();
      ctx.font = "12px system-ui, sans-serif";
      ctx.fillStyle = css("--fg");
      ctx.fillText(name, tip[0] + 6, tip[1] - 4);
    }

    function play(on) {
      state.playing = on;
      const button = control("play");
      button.textContent = on ? "Pause" : "Play";
      button.setAttribute("aria-pressed", String(on));
      let last = null;
      const tick = (now) => {
        if (!state.playing) return;
        if (last === null || now - last >= 50) {  // 40 ms of impact in about 4 s
          last = now;
          state.frame = (state.frame + 1) % count;
          paint();
        }
        requestAnimationFrame(tick);
      };
      if (on) requestAnimationFrame(tick);
    }
    const turn = (azimuth, elevation) => {
      state.azimuth += azimuth;
      state.elevation = Math.min(1.5, Math.max(0.02, state.elevation + elevation));
      paint();
    };

    control("play").addEventListener("click", () => play(!state.playing));
    control("zoom").addEventListener("click", (event) => {
      state.zoom = !state.zoom;
      event.target.setAttribute("aria-pressed", String(state.zoom));
      event.target.textContent = state.zoom ? "Show all" : "Zoom to head";
      paint();
    });
    control("view").addEventListener("click", () => turn(Math.PI / 4, 0));
    slider.addEventListener("input", () => { play(false); state.frame = Number(slider.value); paint(); });
    canvas.addEventListener("keydown", (event) => {
      const act = {
        ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0), ArrowUp: () => turn(0, 0.1), ArrowDown: () => turn(0, -0.1),
        " ": () => play(!state.playing),
      }[event.key];
      if (act) { event.preventDefault(); act(); }
    });
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      const move = (e) => turn(-e.movementX * 0.01, e.movementY * 0.01);
      canvas.addEventListener("pointermove", move);
      canvas.addEventListener("pointerup", () => canvas.removeEventListener("pointermove", move), { once: true });
    });
    new ResizeObserver(paint).observe(canvas);
    redraws.push(paint);
    paint();
  }

  /* ---- start ---------------------------------------------------------------------------- */

  document.querySelectorAll("article.impact").forEach((article) => {
    const number = article.dataset.impact;
    const data = JSON.parse(document.getElementById(`data-${number}`).textContent);
    const history = histories(data);
    article.querySelectorAll(".chart").forEach((figure) => chart(figure, history[figure.dataset.chart], `impact-${number}`));
    const figure = article.querySelector(".replay");
    if (figure) replay(figure, data.replay, history);
  });
  const redraw = () => redraws.forEach((again) => again());
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  addEventListener("beforeprint", () => { document.documentElement.dataset.theme = "light"; redraw(); });
  addEventListener("afterprint", () => { delete document.documentElement.dataset.theme; redraw(); });
  document.documentElement.dataset.ready = "true";
})();
