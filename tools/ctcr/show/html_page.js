"use strict";
// Draws the 3-D views of a page, in mm and true to scale, and gives every command a button that copies it.

const MARGIN = 46; // px around the box, for its labels
const NEAR = 14; // px from the pointer to a point that it shows
const AXES = [0, 1, 2];

const element = (tag, kind, text = "") =>
  Object.assign(document.createElement(tag), { className: kind, textContent: text, ...(tag === "button" && { type: "button" }) });
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`);

function rgb(hex) {
  const number = parseInt(hex.trim().slice(1), 16);
  return [number >> 16, (number >> 8) & 255, number & 255];
}

// The colour of a share between 0 and 1, and of what is beyond.
function shade(share, stops) {
  const along = Math.min(Math.max(share, 0), 1) * (stops.length - 1), at = Math.min(Math.floor(along), stops.length - 2);
  return `rgb(${AXES.map((k) => Math.round(stops[at][k] + (along - at) * (stops[at + 1][k] - stops[at][k])))})`;
}

// 1, 2 or 5 times a power of ten: the step of about five ticks over a length.
function tickStep(length) {
  const power = 10 ** Math.floor(Math.log10(length / 5));
  return power * ([1, 2, 5].find((step) => step * power * 5.5 >= length) ?? 10);
}

// The box of whole steps around the layers that are not hidden, whatever is chosen.
function boxOf(layers) {
  const drawn = layers.some((layer) => !layer.hidden) ? layers.filter((layer) => !layer.hidden) : layers;
  const points = drawn.flatMap((layer) => [...layer.points, ...layer.heads].filter(Boolean));
  const extreme = (best, k) => points.reduce((found, point) => best(found, point[k]), points[0][k]);
  const low = AXES.map((k) => extreme(Math.min, k)), high = AXES.map((k) => extreme(Math.max, k));
  const step = tickStep(Math.max(...AXES.map((k) => high[k] - low[k]), 1e-3));
  for (const k of AXES) {
    low[k] = step * Math.floor(low[k] / step);
    high[k] = Math.max(step * Math.ceil(high[k] / step), low[k] + step);
  }
  const ticks = AXES.map((k) =>
    Array.from({ length: Math.round((high[k] - low[k]) / step) + 1 }, (_, i) => +(low[k] + i * step).toPrecision(9)));
  return { low, high, ticks, centre: AXES.map((k) => (low[k] + high[k]) / 2) };
}

function view(figure) {
  const drawing = JSON.parse(figure.querySelector("script").textContent), layers = drawing.layers;
  const canvas = element("canvas", ""), bar = element("div", "bar"), tip = element("output", "tip");
  canvas.tabIndex = 0;
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", figure.querySelector("figcaption").textContent);
  figure.prepend(bar, canvas, tip);
  for (const layer of layers) {
    layer.points = layer.x.map((x, i) => (x === null ? null : [x, layer.y[i], layer.z[i]]));
    layer.heads = layer.to?.x.map((x, i) => [x, layer.to.y[i], layer.to.z[i]]) ?? [];
  }

  const [ex, ey, ez] = drawing.eye, home = { turn: Math.atan2(ey, ex), rise: Math.atan2(ez, Math.hypot(ex, ey)), zoom: 1 };
  const camera = { ...home };
  let chosen = (drawing.choices?.length ?? 1) - 1, shown = [], waiting = false;

  const visible = (layer) => !layer.hidden && (layer.choice ?? chosen) === chosen;
  const redraw = () => {
    if (!waiting) requestAnimationFrame(() => { waiting = false; draw(); });
    waiting = true;
  };

  function draw() {
    const { clientWidth: width, clientHeight: height } = canvas, density = devicePixelRatio || 1;
    canvas.width = width * density;
    canvas.height = height * density;
    const pen = canvas.getContext("2d");
    pen.scale(density, density);
    pen.lineCap = "round";
    const { low, high, ticks, centre } = boxOf(layers), reach = Math.hypot(...AXES.map((k) => high[k] - low[k])) / 2;
    const { turn, rise, zoom } = camera, [ct, st, cr, sr] = [Math.cos(turn), Math.sin(turn), Math.cos(rise), Math.sin(rise)];
    const right = [-st, ct, 0], up = [-sr * ct, -sr * st, cr], towards = [cr * ct, cr * st, sr];
    const scale = (zoom * (Math.min(width, 1.15 * height) - 2 * MARGIN)) / (2 * reach);
    const project = (point) => {
      const from = AXES.map((k) => point[k] - centre[k]);
      return [width / 2 + scale * dot(right, from), height / 2 - scale * dot(up, from), dot(towards, from)];
    };
    const path = (points) => {
      pen.beginPath();
      points.forEach(([x, y], i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    };
    const disc = (x, y, radius) => {
      pen.beginPath();
      pen.arc(x, y, radius, 0, 2 * Math.PI);
    };

    // Grids on the three far sides, labels along the outline.
    const far = AXES.map((k) => (towards[k] < 0 ? high[k] : low[k])), near = AXES.map((k) => low[k] + high[k] - far[k]);
    pen.strokeStyle = colour("line");
    pen.lineWidth = 1;
    for (const k of AXES)
      for (const other of AXES.filter((axis) => axis !== k))
        for (const tick of ticks[k]) {
          const from = [...far], to = [...far];
          from[k] = to[k] = tick;
          to[other] = near[other];
          path([project(from), project(to)]);
          pen.stroke();
        }
    pen.fillStyle = colour("soft");
    pen.font = "12px system-ui, sans-serif";
    pen.textBaseline = "middle";
    const middle = project(centre);
    for (const k of AXES) {
      const [i, j] = AXES.filter((axis) => axis !== k);
      const edges = [[i, j], [j, i]].map(([back]) => {
        const at = [...near];
        at[back] = far[back];
        at[k] = centre[k];
        return { at, on: project(at) };
      });
      const edge = edges.sort((a, b) => (k === 2 ? a.on[0] - b.on[0] : b.on[1] - a.on[1]))[0];
      const place = (value) => project(AXES.map((axis) => (axis === k ? value : edge.at[axis])));
      const [from, to] = [place(low[k]), place(high[k])], long = Math.hypot(to[0] - from[0], to[1] - from[1]) || 1;
      let out = [(to[1] - from[1]) / long, (from[0] - to[0]) / long];
      if (out[0] * (edge.on[0] - middle[0]) + out[1] * (edge.on[1] - middle[1]) < 0) out = out.map((v) => -v);
      pen.textAlign = out[0] > 0.35 ? "left" : out[0] < -0.35 ? "right" : "center";
      const every = Math.ceil((k === 2 ? 18 : 34) / Math.max(long / (ticks[k].length - 1), 1e-3));
      if (long < 30) continue;
      ticks[k].forEach((tick, n) => {
        const [x, y] = place(tick);
        if (n % every === 0 && (k === 2 || tick !== near[k])) pen.fillText(String(tick), x + 8 * out[0], y + 11 * out[1]);
      });
      pen.fillText(`${"xyz"[k]}, mm`, edge.on[0] + 40 * out[0], edge.on[1] + 30 * out[1]);
    }

    // What is drawn, far before near.
    const stops = ["low", "middle", "high"].map((name) => rgb(colour(name))), paper = colour("paper"), items = [];
    shown = [];
    for (const layer of layers.filter(visible)) {
      const flat = layer.colour && colour(layer.colour), on = layer.points.map((point) => point && project(point));
      const ink = (i) => (layer.value ? shade(layer.value[i] / drawing.scale.most, stops) : flat);
      if (layer.hover) shown.push({ layer, on });
      const line = (points, style, wide) => () => {
        pen.strokeStyle = style;
        pen.lineWidth = wide;
        path(points);
        pen.stroke();
      };
      if (layer.kind === "arrows")
        on.forEach((tail, i) => {
          const head = project(layer.heads[i]), [dx, dy] = [head[0] - tail[0], head[1] - tail[1]], size = Math.hypot(dx, dy);
          const barb = Math.min(5, 0.5 * size) / (size || 1), points = [tail, head];
          for (const side of [1, -1]) points.push([head[0] - barb * (dx - 0.5 * side * dy), head[1] - barb * (dy + 0.5 * side * dx)], head);
          items.push([(tail[2] + head[2]) / 2, line(points, ink(i), layer.size)]);
        });
      else if (layer.kind === "ball")
        on.forEach(([x, y, depth]) =>
          items.push([depth, () => {
            const radius = scale * layer.radius, light = pen.createRadialGradient(x - radius / 3, y - radius / 3, 0, x, y, radius);
            light.addColorStop(0, paper);
            light.addColorStop(0.25, flat);
            light.addColorStop(1, flat);
            disc(x, y, radius);
            pen.globalAlpha = 0.55; // what is inside stays visible
            pen.fillStyle = light;
            pen.fill();
            pen.globalAlpha = 1;
          }]));
      else if (layer.dashed) {
        const run = on.filter(Boolean);
        items.push([Math.min(...run.map((p) => p[2])), () => {
          pen.setLineDash([6, 5]);
          line(run, flat, layer.size)();
          pen.setLineDash([]);
        }]);
      } else if (layer.kind === "line")
        for (let i = 1; i < on.length; i++)
          if (on[i - 1] && on[i]) items.push([(on[i - 1][2] + on[i][2]) / 2, line([on[i - 1], on[i]], flat, layer.size)]);
      if (layer.kind === "points" || layer.marked)
        on.filter(Boolean).forEach(([x, y, depth], i) =>
          items.push([depth, () => {
            disc(x, y, layer.marked ?? layer.size);
            pen.fillStyle = ink(i);
            pen.fill();
          }]));
    }
    items.sort((a, b) => a[0] - b[0]).forEach(([, paint]) => paint());
    figure.dataset.drawn = items.length;
  }

  // Buttons: one of the choices, each layer on or off; the scale of the colours.
  const press = (button, on) => button.setAttribute("aria-pressed", on);
  const choices = (drawing.choices ?? []).map((name, number) => {
    const button = element("button", "choice", name);
    button.onclick = () => {
      chosen = number;
      choices.forEach((one, i) => press(one, i === chosen));
      redraw();
    };
    press(button, number === chosen);
    return button;
  });
  const names = layers.filter((layer) => layer.choice === undefined).map((layer) => {
    const button = element("button", layer.kind, layer.name);
    button.style.setProperty("--own", layer.colour ? `var(--${layer.colour})` : "var(--middle)");
    button.onclick = () => {
      layer.hidden = !layer.hidden;
      press(button, !layer.hidden);
      redraw();
    };
    press(button, !layer.hidden);
    return button;
  });
  bar.append(...choices, ...names);
  if (drawing.scale) {
    const scale = element("span", "scale", drawing.scale.title);
    scale.append(element("span", "", "0"), element("i", ""), element("span", "", `${drawing.scale.most} and more`));
    bar.append(scale);
  }

  // Turning, zooming, and what is under the pointer.
  const move = (turn, rise, zoom = 1) => {
    camera.turn += turn;
    camera.rise = Math.min(Math.max(camera.rise + rise, -1.55), 1.55);
    camera.zoom = Math.min(Math.max(camera.zoom * zoom, 0.3), 40);
    tip.textContent = "";
    redraw();
  };
  const reset = () => move(home.turn - camera.turn, home.rise - camera.rise, home.zoom / camera.zoom);
  const pointers = new Map(), apart = () => { const [a, b] = [...pointers.values()]; return Math.hypot(a[0] - b[0], a[1] - b[1]); };
  canvas.onpointerdown = (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
  };
  canvas.onpointerup = canvas.onpointercancel = (event) => pointers.delete(event.pointerId);
  canvas.onpointerleave = () => (tip.textContent = "");
  canvas.onpointermove = (event) => {
    const held = pointers.get(event.pointerId), before = pointers.size === 2 ? apart() : 0;
    if (!held) return point(event.offsetX, event.offsetY);
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
    if (before) move(0, 0, apart() / before);
    else move(-0.008 * (event.clientX - held[0]), 0.008 * (event.clientY - held[1]));
  };
  canvas.addEventListener("wheel", (event) => {
    if (document.activeElement !== canvas) return; // the page scrolls on
    event.preventDefault();
    move(0, 0, Math.exp(-0.0015 * event.deltaY));
  }, { passive: false });
  canvas.ondblclick = reset;
  canvas.onkeydown = (event) => {
    const moves = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1], "+": [0, 0, 1.2], "-": [0, 0, 1 / 1.2] };
    if (event.key in moves) move(...moves[event.key]);
    else if (event.key === "0") reset();
    else return;
    event.preventDefault();
  };
  function point(x, y) {
    let best = NEAR, text = "";
    for (const { layer, on } of shown)
      on.forEach((place, i) => {
        const distance = place ? Math.hypot(place[0] - x, place[1] - y) : Infinity;
        if (distance < best) {
          best = distance;
          text = Object.entries(layer.hover).map(([name, values]) => `${name}: ${values[i]}`).join(", ");
        }
      });
    tip.textContent = text;
    tip.style.translate = `${Math.min(x + 14, canvas.clientWidth - 180)}px ${canvas.offsetTop + y + 14}px`;
  }

  draw();
  new ResizeObserver(redraw).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
}

// A page from a file has no clipboard in some browsers: what is selected is copied there.
async function copy(code, button) {
  try {
    await navigator.clipboard.writeText(code.textContent);
  } catch {
    getSelection().selectAllChildren(code);
    document.execCommand("copy");
  }
  button.textContent = "copied";
  setTimeout(() => (button.textContent = "copy"), 1500);
}

document.querySelectorAll("figure.view").forEach(view);
for (const code of document.querySelectorAll(".command code")) {
  const button = element("button", "", "copy");
  button.onclick = () => copy(code, button);
  code.after(button);
}
