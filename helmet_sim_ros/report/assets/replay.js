/* The impact in 3-D, in parallel projection: outlines of solids are exact, the painter's order is by their middles. */
"use strict";
(() => {
  const { css } = page;
  const CLOTH = {  // red, green, blue
    jacket: [94, 122, 150], trousers: [62, 66, 76], leather: [44, 44, 48], head: [222, 184, 160], helmet: [48, 104, 186],
  };
  const LEAST_CRUSH = 0.02;  // share of the most that is shown in colour
  const STRIPE = "rgb(238,240,243)", VISOR = [38, 44, 54], INSIDE = "rgb(30,32,36)";
  const TRUNK = ["thorax", "abdomen", "pelvis"];
  const NECK = 0.055, NECK_BELOW = 0.1;  // m, half width of the drawn neck, and where it begins below the head's centre
  /* The drawn helmet, on a shell of radius 1: eye port (half widths, middle, azimuth and elevation
     [deg]), and how far down the shell reaches; as in crush.py. */
  const PORT = [72, 21], PORT_MIDDLE = 4, RIM_FULL = -0.86, RIM_OPEN = -0.22, OPEN_RISE = 0.34;

  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const unit = (a) => { const n = Math.hypot(...a) || 1; return a.map((v) => v / n); };
  const rgb = (color, by) => `rgb(${color.map((v) => Math.round(Math.min(255, by > 1 ? v + (255 - v) * (by - 1) : v * by))).join(",")})`;
  const ring = (count, at) => Array.from({ length: count }, (_, i) => at((2 * Math.PI * i) / count));
  const onSphere = (azimuth, elevation) => {
    const a = (azimuth * Math.PI) / 180, e = (elevation * Math.PI) / 180;
    return [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)];
  };

  /* Columns of the rotation matrix of a quaternion x, y, z, w. */
  function columns([x, y, z, w]) {
    return [
      [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
      [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
      [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
    ];
  }
  const moved = (p, c, [x, y, z]) => p.map((v, i) => v + x * c[0][i] + y * c[1][i] + z * c[2][i]);

  /* Convex hull of points of the plane, in order. */
  function hull(points) {
    const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
    const half = (list) => list.reduce((chain, p) => {
      while (chain.length > 1) {
        const [a, b] = chain.slice(-2);
        if ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 0) break;
        chain.pop();
      }
      return [...chain, p];
    }, []);
    return [...half(sorted).slice(0, -1), ...half(sorted.reverse()).slice(0, -1)];
  }

  /* Outline of an ellipsoid seen along the normal of right and up: points of space. */
  function ellipsoidOutline(p, c, size, right, up, count = 32) {
    return ring(count, (angle) => {
      const e = right.map((v, i) => Math.cos(angle) * v + Math.sin(angle) * up[i]);
      const s = size.map((v, i) => v * v * dot(c[i], e)), n = Math.sqrt(size.reduce((sum, v, i) => sum + (v * dot(c[i], e)) ** 2, 0)) || 1;
      return moved(p, c, s.map((v) => v / n));
    });
  }
  function solidOutline(shape, p, c, right, up) {
    if (shape.kind !== "capsule") return ellipsoidOutline(p, c, shape.kind === "sphere" ? Array(3).fill(shape.size[0]) : shape.size, right, up);
    const ball = Array(3).fill(shape.size[0]);
    return [-1, 1].flatMap((end) => ellipsoidOutline(moved(p, c, [0, 0, end * shape.size[1]]), c, ball, right, up, 20));
  }

  /* Outward normal and colour of each triangle: of the shell, or of the crush below it. */
  function colored({ vertices, faces }, crush, scale) {
    const normals = faces.map((face) => {
      const [a, b, d] = face.map((k) => vertices[k]), u = b.map((v, i) => v - a[i]), w = d.map((v, i) => v - a[i]);
      const n = unit([u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]]);
      return dot(n, a) < 0 ? n.map((v) => -v) : n;
    });
    const colors = faces.map((face) => {
      const share = face.reduce((sum, k) => sum + crush[k], 0) / 3;
      if (share < LEAST_CRUSH) return CLOTH.helmet;
      const at = share * (scale.length - 1), low = Math.min(Math.floor(at), scale.length - 2);
      return scale[low].map((v, i) => v + (at - low) * (scale[low + 1][i] - v));
    });
    return { vertices, faces, normals, colors };
  }

  page.replay = (figure, data, histories) => {
    const scene = data.replay, shapes = scene.shapes;
    const canvas = figure.querySelector("canvas"), ctx = canvas.getContext("2d");
    const { replay_time: time, replay_poses: poses, replay_arrows: arrows } = data.arrays;
    const count = time.length, slider = figure.querySelector("input");
    const control = (name) => figure.querySelector(`[data-act=${name}]`);
    const place = Object.fromEntries(shapes.map((s, i) => [s.name, i]));
    const force = histories.force.series[0][1], clock = histories.force.time;
    const at = (values, t) => values[Math.min(values.length - 1, Math.max(0, Math.round((t - clock[0]) / (clock[1] - clock[0]))))];
    let peak = 0;
    for (let f = 0; f < count; f++) if (at(force, time[f]) > at(force, time[peak])) peak = f;
    const state = { frame: peak, azimuth: -0.9, elevation: 0.22, zoom: false, playing: false };
    const planes = scene.surface.filter((s) => s.kind === "plane").map((s) => [s.rotation[2], s.rotation[5], s.rotation[8]]);
    for (let k = 0; k < 4 && planes.some((normal) => dot(normal, viewed().near) < 0.2); k++) state.azimuth += Math.PI / 2;
    slider.max = count - 1;
    let shell = null;
    if (scene.mesh) page.mesh(scene.mesh).then((mesh) => { shell = colored(mesh, data.arrays.replay_crush, scene.colors); paint(); });

    const pose = (b) => {
      const v = Array.from({ length: 7 }, (_, k) => poses[(b * 7 + k) * count + state.frame]);
      return { shape: shapes[b], p: v.slice(0, 3), c: columns(v.slice(3)) };
    };
    const arrowAt = (i) => Array.from({ length: 6 }, (_, k) => arrows[(i * 6 + k) * count + state.frame]);

    function viewed() {
      const [ca, sa, ce, se] = [Math.cos(state.azimuth), Math.sin(state.azimuth), Math.cos(state.elevation), Math.sin(state.elevation)];
      return { right: [-sa, ca, 0], up: [-se * ca, -se * sa, ce], near: [ce * ca, ce * sa, se] };
    }

    /* Centre and scale [pixel per metre] that show all shapes, or the helmet. */
    function fitted(view, all) {
      const width = canvas.clientWidth, height = canvas.clientHeight;
      if (state.zoom && "head" in place) {
        const { p } = all[place.head], middle = [p[0], p[1], 0.5 * p[2] + 0.1];
        return { scale: Math.min(width, height) / 0.75, x: dot(middle, view.right), y: dot(middle, view.up) };
      }
      let [x0, x1, y0, y1] = [Infinity, -Infinity, Infinity, -Infinity];
      for (const { p } of all) {
        const x = dot(p, view.right), y = dot(p, view.up), r = 0.25;
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
      ctx.lineJoin = "round";
      const view = viewed(), all = shapes.map((_, b) => pose(b)), { scale, x, y } = fitted(view, all);
      const to = (p) => [width / 2 + (dot(p, view.right) - x) * scale, height / 2 - (dot(p, view.up) - y) * scale];
      const draw = { view, to, scale };
      scene.surface.forEach((solid) => surface(solid, all, draw));
      shadow(all, draw);
      const trunk = all.filter(({ shape }) => TRUNK.includes(shape.name));
      const units = all.filter(({ shape }) => !TRUNK.includes(shape.name) && !["head", "helmet"].includes(shape.name))
        .map((one) => ({ depth: dot(one.p, view.near), paint: () => solid(one, draw) }));
      if (trunk.length) {  // where its upper end is: there are neck and head
        const depth = dot(all[place.thorax ?? shapes.indexOf(trunk[0].shape)].p, view.near);
        units.push({ depth, paint: () => {
          if ("head" in place && "thorax" in place) neck(all[place.head], all[place.thorax], draw);
          body(trunk, draw);
        } });
      }
      if ("helmet" in place) {
        units.push({ depth: dot(all[place.helmet].p, view.near), paint: () => {
          const head = () => { if ("head" in place) solid(all[place.head], draw); };
          if (shell) { meshed(all[place.helmet], draw, head); return; }
          head();
          helmet(all[place.helmet], draw);
        } });
      } else if ("head" in place) units.push({ depth: dot(all[place.head].p, view.near), paint: () => solid(all[place.head], draw) });
      units.sort((one, two) => one.depth - two.depth).forEach((one) => one.paint());
      scene.names.forEach((name, i) => arrow(name, i, draw));
      slider.value = state.frame;
      const t = time[state.frame], say = (values, digits) => at(values, t).toFixed(digits);
      control("text").textContent = `${t.toFixed(2)} ms · ${say(histories.acceleration.series[0][1], 0)} g · ` +
        `normal ${say(force, 2)} kN · tangential ${say(histories.force.series[1][1], 2)} kN`;
    }

    function fill(points, style, edge) {
      if (points.length < 3) return;
      ctx.beginPath();
      points.forEach((p) => ctx.lineTo(...p));
      ctx.closePath();
      ctx.fillStyle = style;
      ctx.fill();
      if (!edge) return;
      ctx.strokeStyle = edge;
      ctx.lineWidth = 1;
      ctx.stroke();
    }

    /* Light from the upper left of the picture. */
    function lit(points, color) {
      const xs = points.map((p) => p[0]), ys = points.map((p) => p[1]);
      const [x0, x1, y0, y1] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)], r = Math.max(x1 - x0, y1 - y0, 1);
      const light = ctx.createRadialGradient(x0 + 0.36 * (x1 - x0), y0 + 0.28 * (y1 - y0), 0.05 * r, x0 + 0.5 * (x1 - x0), y0 + 0.5 * (y1 - y0), 0.75 * r);
      light.addColorStop(0, rgb(color, 1.28));
      light.addColorStop(0.45, rgb(color, 1));
      light.addColorStop(1, rgb(color, 0.62));
      return light;
    }
    const edge = (color) => rgb(color, 0.5);

    function solid({ shape, p, c }, { view, to, scale }) {
      const color = CLOTH[shape.cloth];
      const points = hull(solidOutline(shape, p, c, view.right, view.up).map(to));
      if (shape.kind !== "capsule") { fill(points, lit(points, color), edge(color)); return; }
      const [a, b] = [-1, 1].map((end) => to(moved(p, c, [0, 0, end * shape.size[1]]))), r = shape.size[0] * scale;
      let across = unit([-(b[1] - a[1]), b[0] - a[0], 0]);
      if (across[0] + across[1] > 0) across = across.map((v) => -v);  // towards the light
      const middle = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
      const light = ctx.createLinearGradient(middle[0] + across[0] * r, middle[1] + across[1] * r, middle[0] - across[0] * r, middle[1] - across[1] * r);
      light.addColorStop(0, rgb(color, 1.05));
      light.addColorStop(0.3, rgb(color, 1.25));
      light.addColorStop(0.6, rgb(color, 0.95));
      light.addColorStop(1, rgb(color, 0.6));
      fill(points, light, edge(color));
    }

    /* Thorax, abdomen and pelvis as one trunk. */
    function body(trunk, { view, to, scale }) {
      const outline = ({ shape, p, c }) => ellipsoidOutline(p, c, shape.size, view.right, view.up).map(to);
      const by = Object.fromEntries(trunk.map((one) => [one.shape.name, one]));
      const pairs = [["abdomen", "pelvis", "trousers"], ["thorax", "abdomen", "jacket"]].filter(([a, b]) => by[a] && by[b]);
      for (const [a, b, cloth] of pairs) {
        const points = hull([...outline(by[a]), ...outline(by[b])]);
        fill(points, lit(points, CLOTH[cloth]), edge(CLOTH[cloth]));
      }
    }

    /* From the opening of the helmet to the thorax. */
    function neck(head, thorax, { to, scale }) {
      const ends = [moved(head.p, head.c, [0, 0, -NECK_BELOW]), thorax.p];
      ctx.lineCap = "butt";
      for (const [width, style] of [[2 * NECK * scale, edge(CLOTH.head)], [2 * NECK * scale - 2, rgb(CLOTH.head, 0.85)]]) {
        ctx.strokeStyle = style;
        ctx.lineWidth = Math.max(1, width);
        stroke(ends.map(to));
      }
    }

    /* An ellipsoid cut off at the neck, with eye port, visor, stripe and vents; of an open helmet the rim alone. */
    function helmet({ shape, p, c }, { view, to }) {
      const { size } = shape, open = scene.face === "open", color = CLOTH.helmet;
      const toward = unit(size.map((v, i) => dot(c[i], view.near) / v));  // on the unit sphere: seen if u . toward > 0
      const space = (u) => to(moved(p, c, u.map((v, i) => v * size[i])));
      const rim = ring(48, (a) => {
        const z = (open ? RIM_OPEN + OPEN_RISE * Math.max(0, Math.cos(a) + 0.1) : RIM_FULL), r = Math.sqrt(Math.max(0, 1 - z * z));
        return [r * Math.cos(a), r * Math.sin(a), z];
      });
      const level = (u) => (open ? RIM_OPEN + OPEN_RISE * Math.max(0, u[0] + 0.1) : RIM_FULL);
      const side = unit(Math.abs(toward[2]) < 0.9 ? [toward[1], -toward[0], 0] : [0, toward[2], -toward[1]]);
      const other = [toward[1] * side[2] - toward[2] * side[1], toward[2] * side[0] - toward[0] * side[2], toward[0] * side[1] - toward[1] * side[0]];
      const silhouette = ring(64, (a) => side.map((v, i) => Math.cos(a) * v + Math.sin(a) * other[i]));
      const shell = hull([...silhouette.filter((u) => u[2] >= level(u)), ...rim].map(space));
      fill(shell, lit(shell, color), edge(color));
      if (toward[2] < 0) fill(hull(rim.map(space)), INSIDE, edge(color));  // seen from below
      ctx.save();
      ctx.beginPath();
      shell.forEach((q) => ctx.lineTo(...q));
      ctx.clip();
      const seen = (u) => dot(u, toward) > 0;
      const outward = (u) => (seen(u) ? u : unit(u.map((v, i) => v - dot(u, toward) * toward[i])));  // hidden: to the outline
      /* A part of the shell: at(i, j) gives its grid of rows and columns; cells that are not seen are left out. */
      const patch = (rows, steps, at, style) => {
        ctx.beginPath();
        for (let i = 0; i < rows; i++) for (let j = 0; j < steps; j++) {
          const cell = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
          if (!cell.some(seen)) continue;
          cell.map(outward).map(space).forEach((q, k) => (k ? ctx.lineTo : ctx.moveTo).call(ctx, ...q));
          ctx.closePath();
        }
        ctx.fillStyle = style;
        ctx.fill();
      };
      const line = (points) => points.forEach((u, i) => {
        if (i && seen(u) && seen(points[i - 1])) stroke([space(points[i - 1]), space(u)]);
      });
      const [first, span] = open ? [42, 120] : [30, 150];
      patch(1, 24, (i, j) => {
        const e = ((first + (span * j) / 24) * Math.PI) / 180;
        return unit([Math.cos(e), 0.09 - 0.18 * i, Math.sin(e)]);
      }, STRIPE);
      if (!open) {
        const port = (grow) => (i, j) => {
          const a = (2 * Math.PI * j) / 64, squared = ((i / 6) * (Math.cos(a) ** 4 + Math.sin(a) ** 4) ** -0.25);
          return onSphere((PORT[0] + grow) * squared * Math.cos(a), PORT_MIDDLE + (PORT[1] + grow) * squared * Math.sin(a));
        };
        patch(6, 64, port(4), rgb(color, 0.55));
        patch(6, 64, port(0), lit(shell, VISOR));
        ctx.lineWidth = 1.5;
        ctx.strokeStyle = "rgb(150,164,184)";  // the visor's lower edge
        line(Array.from({ length: 21 }, (_, i) => onSphere(-64 + 6.4 * i, PORT_MIDDLE - 13)));
        ctx.strokeStyle = INSIDE;
        ctx.lineWidth = 3;
        for (const half of [-1, 1]) line([6, 12, 18, 24].map((a) => onSphere(half * a, -38)));
        for (const half of [-1, 1]) {
          patch(1, 16, (i, j) => onSphere(half * 84 + 6 * i * Math.cos((Math.PI * j) / 8), PORT_MIDDLE + 6 * i * Math.sin((Math.PI * j) / 8)), rgb(color, 0.45));
        }
      }
      ctx.restore();
      ctx.strokeStyle = INSIDE;
      ctx.lineWidth = 2;
      line([...rim, rim[0]]);
    }

    /* A helmet of its own shape: what shows its inner side, the head, what shows its outer side; each from the farthest
       triangle to the nearest. */
    function meshed({ p, c }, { view, to }, head) {
      const light = unit(view.right.map((v, i) => -0.5 * v + 0.7 * view.up[i] + 0.8 * view.near[i]));
      const places = shell.vertices.map((v) => moved(p, c, v)), points = places.map(to);
      const order = shell.faces.map((face, i) => {
        const n = shell.normals[i], turned = c[0].map((_, k) => n[0] * c[0][k] + n[1] * c[1][k] + n[2] * c[2][k]);
        return { face, i, turned, outer: dot(turned, view.near) > 0, depth: face.reduce((sum, k) => sum + dot(places[k], view.near), 0) };
      });
      order.sort((one, two) => one.outer - two.outer || one.depth - two.depth);
      let before = true;
      for (const { face, i, turned, outer } of order) {
        if (outer && before) { head(); before = false; }
        const style = outer ? rgb(shell.colors[i], 0.55 + 0.6 * Math.max(0, dot(turned, light))) : INSIDE;
        fill(face.map((k) => points[k]), style, style);
      }
    }

    function stroke(points) {
      ctx.beginPath();
      points.forEach((q) => ctx.lineTo(...q));
      ctx.stroke();
    }

    /* ---- what is struck -------------------------------------------------------------------- */

    const flat = scene.surface.find((s) => s.kind === "plane" && Math.abs(s.rotation[8] - 1) < 1e-9);

    function shadow(all, { to }) {
      if (!flat) return;
      ctx.beginPath();
      for (const { shape, p, c } of all) {
        const points = hull(solidOutline(shape, p, c, [1, 0, 0], [0, 1, 0]));
        points.forEach(([px, py], i) => (i ? ctx.lineTo : ctx.moveTo).call(ctx, ...to([px, py, flat.position[2]])));
        ctx.closePath();
      }
      ctx.fillStyle = css("--shadow");
      ctx.fill();
    }

    function surface(one, all, draw) {
      const { view, to } = draw, r = one.rotation, c = [0, 1, 2].map((k) => [r[k], r[3 + k], r[6 + k]]), p = one.position;
      const tone = css("--ground"), line = css("--line");
      if (one.kind === "plane") {
        if (dot(c[2], view.near) <= 0) return;  // from below
        const head = all[Math.max(place.head ?? 0, 0)].p, d = head.map((v, i) => v - p[i]);
        const [cx, cy] = [dot(d, c[0]), dot(d, c[1])].map((v) => Math.round(v * 4) / 4);
        const q = (a, b) => to(moved(p, c, [cx + a, cy + b, 0]));
        fill([q(-2, -2), q(2, -2), q(2, 2), q(-2, 2)], tone);
        ctx.strokeStyle = line;
        ctx.lineWidth = 1;
        for (let k = -2; k <= 2; k += 0.25) { stroke([q(k, -2), q(k, 2)]); stroke([q(-2, k), q(2, k)]); }
        return;
      }
      if (one.kind === "box") {
        for (const axis of [0, 1, 2]) for (const sign of [-1, 1]) {
          if (sign * dot(c[axis], view.near) <= 0) continue;
          const [i, j] = [0, 1, 2].filter((k) => k !== axis), corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([a, b]) => {
            const at = [0, 0, 0];
            at[axis] = sign * one.size[axis]; at[i] = a * one.size[i]; at[j] = b * one.size[j];
            return to(moved(p, c, at));
          });
          fill(corners, tone, css("--muted"));
        }
        return;
      }
      if (one.kind === "cylinder") {
        const cap = (end) => ring(40, (a) => to(moved(p, c, [one.size[0] * Math.cos(a), one.size[0] * Math.sin(a), end * one.size[1]])));
        fill(hull([...cap(-1), ...cap(1)]), tone, css("--muted"));
        fill(cap(Math.sign(dot(c[2], view.near)) || 1), tone, css("--muted"));
        return;
      }
      fill(hull(solidOutline(one, p, c, view.right, view.up).map(to)), tone, css("--muted"));
    }

    /* Tails where the force acts; the name stands beyond the tip, away from the other arrow. */
    function arrow(name, i, { to }) {
      const v = arrowAt(i), tail = to(v.slice(0, 3)), whole = to(v.slice(3));
      const tip = whole.map((w, k) => tail[k] + (state.zoom || !("thorax" in place) ? 0.4 : 1) * (w - tail[k]));  // to fit the view
      const dx = tip[0] - tail[0], dy = tip[1] - tail[1], long = Math.hypot(dx, dy);
      if (long < 3) return;
      const [ux, uy] = [dx / long, dy / long], size = Math.min(12, long);
      ctx.strokeStyle = ctx.fillStyle = scene.arrowColors[i];
      ctx.lineWidth = 4;
      ctx.lineCap = "butt";
      stroke([tail, [tip[0] - ux * size, tip[1] - uy * size]]);
      ctx.beginPath();
      ctx.moveTo(...tip);
      ctx.lineTo(tip[0] - ux * size - uy * size * 0.6, tip[1] - uy * size + ux * size * 0.6);
      ctx.lineTo(tip[0] - ux * size + uy * size * 0.6, tip[1] - uy * size - ux * size * 0.6);
      ctx.fill();
      ctx.font = '12px system-ui, "Liberation Sans", sans-serif';
      const wide = ctx.measureText(name).width, left = ux < -0.3 ? tip[0] - wide - 8 : ux > 0.3 ? tip[0] + 8 : tip[0] - wide / 2;
      const base = Math.abs(ux) <= 0.3 ? tip[1] + (uy < 0 ? -8 : 18) : tip[1] + 4;
      ctx.strokeStyle = css("--soft");
      ctx.lineWidth = 4;
      ctx.strokeText(name, left, base);
      ctx.fillStyle = css("--fg");
      ctx.fillText(name, left, base);
    }

    /* ---- controls -------------------------------------------------------------------------- */

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
    page.redraws.push(paint);
    paint();
  };
})();
