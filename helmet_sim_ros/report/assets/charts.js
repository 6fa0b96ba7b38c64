/* Histories over time, with uPlot. */
"use strict";
(() => {
  const { css } = page;
  const length3 = (x, y, z) => x.map((_, i) => Math.hypot(x[i], y[i], z[i]));
  const PAPER = [330, 170];  // pixel, two side by side inside the margins of A4 and Letter
  const HIDDEN = new Set(["x", "y", "z"]);  // at first, to keep the picture calm

  /* What an impact's charts show: name -> unit, series [label, values, colour, width]. */
  page.histories = (data) => {
    const a = data.arrays, time = page.times(data);
    const axes = (letter, width) => [["x", "--c3"], ["y", "--c4"], ["z", "--c5"]].map(([axis, color]) => [axis, a[letter + axis], color, width]);
    const resultant = (letter) => ["resultant", length3(a[`${letter}x`], a[`${letter}y`], a[`${letter}z`]), "--c1", 2];
    const chart = (name, unit, series) => ({
      unit, time, series: series.filter((s) => s[1] && s[1].length), limits: data.limits[name], marks: data.marks[name],
      window: name === "acceleration" ? data.window : null,
    });
    return {
      acceleration: chart("acceleration", "g", [resultant("a"), ["resultant, CFC 1000", a.cfc, "--c2", 1.5], ...axes("a", 1)]),
      force: chart("force", "kN", [["ground, normal", a.fn, "--c1", 2], ["ground, tangential", a.ft, "--c2", 1.5],
                                   ["helmet on head", a.fc, "--c3", 1.5]]),
      compression: chart("compression", "mm", [resultant("d"), ...axes("d", 1.2)]),
      spin: chart("spin", "krad/s²", [resultant("s"), ...axes("s", 1.2)]),
      rate: chart("rate", "rad/s", [resultant("w"), ...axes("w", 1.2)]),
    };
  };

  /* The same history of several logs. */
  page.overlaid = (data) => {
    const time = page.times(data), colors = ["--c1", "--c2", "--c3", "--c4", "--c5"];
    const chart = (letter, unit) => ({
      unit, time, limits: [], marks: [], window: null,
      series: data.names.map((name, i) => [
        name, Array.from(time, (_, k) => data.arrays[letter + i][k] ?? null), colors[i % colors.length], 1.8,
      ]),
    });
    return { acceleration: chart("a", "g"), force: chart("f", "kN"), spin: chart("s", "krad/s²") };
  };

  function number(value) {
    const digits = Math.abs(value) < 10 ? 2 : Math.abs(value) < 1000 ? 1 : 0;
    return value.toFixed(digits).replace("-", "−");
  }

  /* ---- what is written into a plot: never over each other -------------------------------- */

  class Labels {
    constructor(u) {
      this.u = u;
      this.ratio = devicePixelRatio;
      this.taken = [];
    }

    font() {
      this.u.ctx.font = `${11 * this.ratio}px system-ui, "Liberation Sans", sans-serif`;
    }

    /* Write at the first of some places [left, baseline] that is free; nowhere if none is. */
    write(text, places, color) {
      const { ctx, bbox } = this.u, high = 13 * this.ratio, pad = 3 * this.ratio;
      ctx.save();
      this.font();
      ctx.textAlign = "left";
      ctx.textBaseline = "alphabetic";
      const wide = ctx.measureText(text).width;
      for (const [left, base] of places(wide, high)) {
        const box = [left - pad, base - high, left + wide + pad, base + pad];
        const inside = box[0] >= bbox.left && box[2] <= bbox.left + bbox.width && box[1] >= bbox.top && box[3] <= bbox.top + bbox.height;
        if (!inside || this.taken.some((b) => box[0] < b[2] && b[0] < box[2] && box[1] < b[3] && b[1] < box[3])) continue;
        this.taken.push(box);
        ctx.globalAlpha = 0.8;  // a curve behind it stays to be seen, but does not strike it out
        ctx.fillStyle = css("--bg");
        ctx.fillRect(box[0], box[1], box[2] - box[0], box[3] - box[1]);
        ctx.globalAlpha = 1;
        ctx.fillStyle = color;
        ctx.fillText(text, left, base);
        break;
      }
      ctx.restore();
    }
  }

  function shade(u, range) {
    if (!range) return;
    const x0 = Math.max(u.valToPos(range[0], "x", true), u.bbox.left);
    const x1 = Math.min(u.valToPos(range[1], "x", true), u.bbox.left + u.bbox.width);
    if (x1 <= x0) return;
    u.ctx.fillStyle = css("--window");
    u.ctx.fillRect(x0, u.bbox.top, x1 - x0, u.bbox.height);
  }

  function annotate(u, spec) {
    const { ctx, bbox } = u, labels = new Labels(u), gap = 6 * labels.ratio;
    const right = bbox.left + bbox.width, bottom = bbox.top + bbox.height;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    const r = 4 * labels.ratio, marks = [];
    for (const mark of spec.marks) {
      const index = spec.series.findIndex((s) => s[0] === mark.series);
      if (index < 0 || !u.series[index + 1].show) continue;
      const x = u.valToPos(mark.time, "x", true), y = u.valToPos(mark.value, "y", true);
      ctx.fillStyle = css(spec.series[index][2]);
      ctx.beginPath();
      ctx.arc(x, y, r, 0, 2 * Math.PI);
      ctx.fill();
      labels.taken.push([x - r, y - r, x + r, y + r]);
      marks.push([mark.label, x, y]);
    }
    for (const limit of spec.limits) {
      const y = u.valToPos(limit.value, "y", true), inside = y >= bbox.top;
      if (inside) {
        ctx.strokeStyle = css("--fail");
        ctx.setLineDash([6, 4]);
        ctx.beginPath();
        ctx.moveTo(bbox.left, y);
        ctx.lineTo(right, y);
        ctx.stroke();
        ctx.setLineDash([]);
      }
      labels.write(inside ? limit.label : `${limit.label}, above this plot`, (wide, high) => {
        const top = inside ? y : bbox.top, left = right - wide - gap;
        return [[left, top - gap], [left, top + high], [left, top + 2 * high], [left - wide - 4 * gap, top + high]];
      }, css("--fail"));
    }
    for (const [label, x, y] of marks) {
      labels.write(label, (wide, high) => [
        [x + 2 * gap, y + high / 3], [x - wide - 2 * gap, y + high / 3], [x + 2 * gap, y - high], [x - wide - 2 * gap, y - high],
        [x + 2 * gap, y + 1.6 * high], [x - wide - 2 * gap, y + 1.6 * high], [x + 2 * gap, y + 3 * high],
      ], css("--fg"));
    }
    if (spec.window) {
      const x0 = u.valToPos(spec.window[0], "x", true), x1 = u.valToPos(spec.window[1], "x", true);
      labels.write("HIC window", (wide, high) => [[(x0 + x1 - wide) / 2, bottom - gap], [(x0 + x1 - wide) / 2, bbox.top + high]], css("--muted"));
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

  const printing = () => document.documentElement.dataset.printing === "true";
  const plotWidth = (host) => (printing() ? PAPER[0] : Math.max(240, host.clientWidth));

  /* The largest amount of a curve, with its sign: what the legend says while nothing is pointed at. */
  function peakOf(values) {
    let peak = 0;
    for (const value of values) if (value !== null && Math.abs(value) > Math.abs(peak)) peak = value;
    return peak;
  }

  function draw(host, spec, key, shown) {
    const axis = { stroke: css("--fg"), grid: { stroke: css("--line"), width: 1 }, ticks: { stroke: css("--line") }, font: '11px system-ui, "Liberation Sans", sans-serif' };
    const options = {
      width: plotWidth(host), height: printing() ? PAPER[1] : 250,
      scales: { x: { time: false }, y: { range: yRange(spec) } },
      axes: [{ ...axis, size: 34 }, { ...axis, size: 44 }],
      cursor: { sync: { key }, drag: { x: true, y: false } },
      series: [
        { label: "time", value: (u, v) => (v == null ? "" : `${v.toFixed(2)} ms`) },
        ...spec.series.map(([label, values, color, width], i) => ({
          label, width, stroke: css(color), show: shown[i], points: { show: false },
          value: (u, v) => (v == null ? `max ${number(peakOf(values))}` : number(v)),
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

  page.chart = (figure, spec, key) => {
    const host = figure.querySelector(".plot"), shown = spec.series.map((s) => !HIDDEN.has(s[0]) || spec.unit === "mm");
    let plot = draw(host, spec, key, shown), width = host.clientWidth;
    const renew = () => {
      const { min, max } = plot.scales.x;
      plot.destroy();
      plot = draw(host, spec, key, shown);
      plot.setScale("x", { min, max });
    };
    const all = () => plot.setScale("x", { min: spec.time[0], max: spec.time[spec.time.length - 1] });
    page.redraws.push(renew);
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
      if (host.clientWidth && host.clientWidth !== width && !printing()) {
        width = host.clientWidth;
        plot.setSize({ width: plotWidth(host), height: plot.height });
      }
    }).observe(host);
  };
})();
