// The helmet as dots on its shell with its struck points; turned by dragging.
"use strict";
(() => {
  const scene = JSON.parse(document.getElementById("scene").textContent);
  const canvas = document.getElementById("view"), hover = document.getElementById("hover");
  const context = canvas.getContext("2d");
  const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const dots = scene.dots || [], N = scene.dots ? 0 : 900, golden = Math.PI * (3 - Math.sqrt(5));
  for (let i = 0; i < N; i++) {
    const z = 1 - (2 * i + 1) / N, r = Math.sqrt(1 - z * z);
    const u = [r * Math.cos(golden * i), r * Math.sin(golden * i), z];
    dots.push(u.map((v, k) => v * scene.axes[k] + scene.center[k]));
  }
  let yaw = -0.6, pitch = 0.35, drawn = [];
  const color = (m) => m === null ? style("--muted") : m < 0 ? style("--fail")
    : m < 0.2 ? style("--warn") : style("--pass");
  function project(p, scale, w, h) {
    const a = Math.cos(yaw), b = Math.sin(yaw), c = Math.cos(pitch), d = Math.sin(pitch);
    const x = a * p[1] - b * p[0], y = a * p[0] + b * p[1];
    return [w / 2 - scale * x, h / 2 - scale * (c * p[2] - d * y), c * y + d * p[2]];
  }
  function draw() {
    const ratio = window.devicePixelRatio || 1, w = canvas.clientWidth, h = canvas.clientHeight;
    canvas.width = w * ratio; canvas.height = h * ratio;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, w, h);
    const scale = 0.42 * Math.min(w, h) / Math.max(...scene.axes);
    for (const p of dots) {
      const [x, y, depth] = project(p, scale, w, h);
      context.globalAlpha = depth > 0 ? 0.6 : 0.15;
      context.fillStyle = style("--muted");
      context.fillRect(x - 1, y - 1, 2, 2);
    }
    drawn = scene.points.map((p) => ({ p, at: project(p.at, scale, w, h) }));
    drawn.sort((a, b) => a.at[2] - b.at[2]);
    context.font = "13px system-ui, sans-serif";
    for (const { p, at } of drawn) {
      context.globalAlpha = at[2] > 0 ? 1 : 0.35;
      context.fillStyle = color(p.margin);
      context.beginPath();
      context.arc(at[0], at[1], 8, 0, 2 * Math.PI);
      context.fill();
      context.fillStyle = style("--fg");
      const margin = p.margin === null ? "" : ` ${(100 * p.margin).toFixed(0)} %`;
      context.fillText(p.name + margin, at[0] + 11, at[1] + 4);
    }
    context.globalAlpha = 1;
    const front = project([scene.axes[0] * 1.25, 0, 0], scale, w, h);
    context.fillStyle = style("--muted");
    context.fillText("front", front[0], front[1]);
  }
  let from = null;
  canvas.addEventListener("pointerdown", (e) => {
    from = [e.clientX, e.clientY];
    canvas.setPointerCapture(e.pointerId);
  });
  canvas.addEventListener("pointerup", () => { from = null; });
  canvas.addEventListener("pointermove", (e) => {
    if (from) {
      yaw += (e.clientX - from[0]) * 0.01;
      pitch = Math.max(-1.5, Math.min(1.5, pitch + (e.clientY - from[1]) * 0.01));
      from = [e.clientX, e.clientY];
      draw();
      return;
    }
    const box = canvas.getBoundingClientRect();
    const near = drawn.filter(({ at }) =>
      Math.hypot(at[0] - e.clientX + box.left, at[1] - e.clientY + box.top) < 12);
    hover.textContent = near.length ? near[near.length - 1].p.rows.join("; ") : "\u00a0";
  });
  window.addEventListener("resize", draw);
  draw();
})();
