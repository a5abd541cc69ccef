"use strict";
// A mode in motion: Re(û e^{jφ}) on the outer facets, turned by dragging. Drawn on a plain canvas, where a depth buffer
// decides what hides what, or by the graphics card: viewer.js, where the page has it and there is WebGL. Nothing is fetched.
let data, points, real, imag, facets, edges, body, segments, segmentBody, count, space, reach, ramp, bodies;
let moved, seen, size; // in the model; right and down in pixels, towards the eye; |u| of the largest amplitude
let card = null, cardless = false; // what draws instead of the canvas; whether there is none

function decoded(text, Kind) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Kind(bytes.buffer);
}

// Everything about a model, its mode included.
function load(given) {
  data = given;
  const Index = data.wide ? Uint32Array : Uint16Array;
  points = decoded(data.points, Float32Array);
  facets = decoded(data.facets, Index);
  edges = decoded(data.edges, Index);
  body = decoded(data.body, Uint8Array);
  segments = decoded(data.segments, Index);
  segmentBody = decoded(data.segment_body, Uint8Array);
  count = points.length / 3;
  space = data.dimension === 3;
  // The box around the model fits the window as it is first seen; turning does not change the size of things.
  reach = directions(data.elevation, data.azimuth)
    .map((d) => Math.max(1e-12, d.reduce((sum, v, i) => sum + Math.abs(v) * data.half[i], 0)));
  unpack(data);
  if (!card && !cardless && globalThis.stridorViewer && body.length) open();
  if (card) card.load(model());
  else plain();
}
// What only the canvas needs of a model.
function plain() {
  moved = new Float32Array(3 * count);
  seen = new Float32Array(3 * count);
  size = new Float32Array(count);
  ramp = shades(data.ramp);
  bodies = shades(data.pale);
}
const model = () => ({ data, points, real, imag, facets, edges, body, segments, segmentBody });

// Another mode of the same model.
function change(motion) {
  unpack(motion);
  if (card) card.change(model());
}
function unpack(motion) {
  Object.assign(data, motion);
  real = decoded(data.real, Int16Array);
  imag = decoded(data.imag, Int16Array);
}

const canvas = document.getElementById("view");
const context = canvas.getContext("2d");
const control = (name) => document.getElementById(name);
const start = { elevation: 0, azimuth: 0, zoom: 1, x: 0, y: 0 };
const state = { ...start, phase: 0, playing: !matchMedia("(prefers-reduced-motion: reduce)").matches };

let paper = 0xffffffff; // behind it all
let image, pixels, depth, inked, width = 0, height = 0;

// The graphics card draws behind the canvas, which stays where keys and pointer go and says what is seen.
function open() {
  card = globalThis.stridorViewer(canvas, close);
  cardless = !card;
  if (!card) return;
  canvas.width = canvas.height = 1; // transparent, and no memory
  image = pixels = depth = inked = null;
  card.paper(colourOf(paper));
  if (width) resize();
}
// Where the graphics card is taken away, the canvas goes on.
function close() {
  if (!card) return;
  card.end();
  card = null;
  cardless = true;
  plain();
  resize();
  later();
}
const colourOf = (p) => ((p & 255) << 16) | (p & 0xff00) | ((p >> 16) & 255);

function resize() {
  const ratio = Math.min(window.devicePixelRatio || 1, (card ? card.coarse : facets.length > 60000) ? 1 : 2);
  width = Math.max(2, Math.round(canvas.clientWidth * ratio));
  height = Math.max(2, Math.round(canvas.clientHeight * ratio));
  if (card) {
    card.resize(width, height);
    return;
  }
  canvas.width = width;
  canvas.height = height;
  image = context.createImageData(width, height);
  pixels = new Uint32Array(image.data.buffer);
  depth = new Float32Array(width * height);
  inked = new Uint8Array(width * height);
}

function move(amplitude) {
  const c = Math.cos(state.phase) / 32767, s = Math.sin(state.phase) / 32767;
  for (let k = 0; k < count; k++) {
    let sum = 0;
    for (let i = 3 * k; i < 3 * k + 3; i++) {
      const u = real[i] * c - imag[i] * s;
      sum += u * u;
      moved[i] = points[i] + amplitude * data.scale * u;
    }
    const share = Math.min(1, Math.sqrt(sum));
    size[k] = data.bent ? Math.sqrt(share) : share;
  }
}

function directions(elevation, azimuth) {
  if (!space) return [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  const rise = (elevation * Math.PI) / 180, turn = (azimuth * Math.PI) / 180;
  const ce = Math.cos(rise), se = Math.sin(rise), ca = Math.cos(turn), sa = Math.sin(turn);
  return [[-sa, ca, 0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]];
}
// From where it is seen, how large a metre is and where its middle comes to be [pixels].
function sight() {
  const fit = Math.min(width / (2 * reach[0]), height / (2 * reach[1]));
  return {
    axes: directions(state.elevation, state.azimuth), factor: 0.96 * fit * state.zoom,
    x: width / 2 + state.x * width, y: height / 2 + state.y * height,
  };
}
function project() {
  const { axes: [right, up, toward], factor, x, y } = sight();
  for (let i = 0; i < 3 * count; i += 3) {
    const a = moved[i], b = moved[i + 1], c = moved[i + 2];
    seen[i] = x + factor * (a * right[0] + b * right[1] + c * right[2]);
    seen[i + 1] = y - factor * (a * up[0] + b * up[1] + c * up[2]);
    seen[i + 2] = factor * (a * toward[0] + b * toward[1] + c * toward[2]);
  }
}

// Colours times 64 steps of brightness, as the canvas stores them.
const STEPS = 64;
function shades(colours) {
  const made = new Uint32Array(colours.length * STEPS);
  colours.forEach(([r, g, b], k) => {
    for (let s = 0; s < STEPS; s++) {
      const light = s / (STEPS - 1);
      const [x, y, z] = [r, g, b].map((v) => Math.round(v * light));
      made[k * STEPS + s] = (0xff000000 | (z << 16) | (y << 8) | x) >>> 0;
    }
  });
  return made;
}

// Seen coordinates point down, so the lamp at the upper left does too.
const lamp = [-0.35, -0.45, 0.82].map((v) => v / Math.hypot(0.35, 0.45, 0.82));
// Triangles repeat their last corner; the normal from the diagonals holds for both.
function brightness(a, b, c, d) {
  const ux = seen[c] - seen[a], uy = seen[c + 1] - seen[a + 1], uz = seen[c + 2] - seen[a + 2];
  const vx = seen[d] - seen[b], vy = seen[d + 1] - seen[b + 1], vz = seen[d + 2] - seen[b + 2];
  let x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
  const length = Math.hypot(x, y, z) || 1, side = z < 0 ? -1 : 1;
  const lit = (side * (x * lamp[0] + y * lamp[1] + z * lamp[2])) / length;
  return space ? 0.6 + 0.4 * Math.max(0, lit) : 1;
}

function fill(a, b, c, light, tint) {
  const ax = seen[a], ay = seen[a + 1], az = seen[a + 2];
  const bx = seen[b], by = seen[b + 1], bz = seen[b + 2];
  const cx = seen[c], cy = seen[c + 1], cz = seen[c + 2];
  const twice = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
  if (Math.abs(twice) < 1e-6) return;
  const left = Math.max(0, Math.ceil(Math.min(ax, bx, cx) - 0.5));
  const last = Math.min(width - 1, Math.floor(Math.max(ax, bx, cx) - 0.5));
  const top = Math.max(0, Math.ceil(Math.min(ay, by, cy) - 0.5));
  const bottom = Math.min(height - 1, Math.floor(Math.max(ay, by, cy) - 0.5));
  const shade = Math.round(light * (STEPS - 1)), levels = data.ramp.length - 1;
  const sa = size[a / 3], sb = size[b / 3], sc = size[c / 3];
  for (let y = top; y <= bottom; y++) {
    for (let x = left; x <= last; x++) {
      const px = x + 0.5, py = y + 0.5;
      const u = ((bx - px) * (cy - py) - (by - py) * (cx - px)) / twice;
      const v = ((cx - px) * (ay - py) - (cy - py) * (ax - px)) / twice;
      const w = 1 - u - v;
      if (u < -1e-6 || v < -1e-6 || w < -1e-6) continue;
      const near = u * az + v * bz + w * cz, at = y * width + x;
      if (near <= depth[at]) continue;
      depth[at] = near;
      pixels[at] = tint < 0
        ? ramp[Math.round((u * sa + v * sb + w * sc) * levels) * STEPS + shade]
        : bodies[tint * STEPS + shade];
    }
  }
}

function mesh() {
  inked.fill(0); // where edges meet, a pixel is darkened once
  for (let e = 0; e < edges.length; e += 2) {
    const a = 3 * edges[e], b = 3 * edges[e + 1];
    const dx = seen[b] - seen[a], dy = seen[b + 1] - seen[a + 1], dz = seen[b + 2] - seen[a + 2];
    const steps = Math.ceil(Math.max(Math.abs(dx), Math.abs(dy))) + 1;
    if (steps > 4 * (width + height)) continue;
    for (let k = 0; k < steps; k++) {
      const t = k / steps;
      const x = Math.floor(seen[a] + t * dx), y = Math.floor(seen[a + 1] + t * dy);
      if (x < 0 || y < 0 || x >= width || y >= height) continue;
      const at = y * width + x;
      if (seen[a + 2] + t * dz < depth[at] - 2 || depth[at] === -Infinity) continue;
      if (inked[at]) continue;
      inked[at] = 1;
      const p = pixels[at];
      pixels[at] = (0xff000000 | (((p >> 16) & 255) * 0.68) << 16 | (((p >> 8) & 255) * 0.68) << 8
        | ((p & 255) * 0.68)) >>> 0;
    }
  }
}

function lines() {
  context.lineCap = "round";
  context.lineWidth = Math.max(3, width / 260);
  for (let s = 0; s < segmentBody.length; s++) {
    const a = segments[2 * s], b = segments[2 * s + 1];
    const level = Math.round(((size[a] + size[b]) / 2) * (data.ramp.length - 1));
    const colour = control("colours").value === "size" ? data.ramp[level] : data.colours[segmentBody[s]];
    context.strokeStyle = context.fillStyle = `rgb(${colour.join(",")})`;
    context.beginPath();
    if (a === b) { // a point mass; a line without length is not drawn
      context.arc(seen[3 * a], seen[3 * a + 1], 1.2 * context.lineWidth, 0, 2 * Math.PI);
      context.fill();
      continue;
    }
    context.moveTo(seen[3 * a], seen[3 * a + 1]);
    context.lineTo(seen[3 * b], seen[3 * b + 1]);
    context.stroke();
  }
}

function draw() {
  const byBody = control("colours").value === "body", amplitude = Number(control("amplitude").value);
  if (card) {
    const far = Math.hypot(...data.half) + Math.abs(amplitude * data.scale);
    card.draw({ ...sight(), far, amplitude: amplitude * data.scale, phase: state.phase, byBody });
    return;
  }
  move(amplitude);
  project();
  pixels.fill(paper);
  depth.fill(-Infinity);
  for (let f = 0; f < body.length; f++) {
    const a = 3 * facets[4 * f], b = 3 * facets[4 * f + 1], c = 3 * facets[4 * f + 2], d = 3 * facets[4 * f + 3];
    const across = (seen[c] - seen[a]) * (seen[d + 1] - seen[b + 1]) - (seen[c + 1] - seen[a + 1]) * (seen[d] - seen[b]);
    // Facets of closed bodies that turn their back to the eye are behind others; y points down here.
    if (data.closed && across > 0) continue;
    const light = brightness(a, b, c, d);
    const tint = byBody ? body[f] : -1;
    fill(a, b, c, light, tint);
    if (c !== d) fill(a, c, d, light, tint);
  }
  mesh();
  context.putImageData(image, 0, 0);
  lines();
}

function legend() {
  const box = control("legend");
  box.replaceChildren();
  const entry = (text, style, kind) => {
    const item = document.createElement("span"), patch = document.createElement("i");
    patch.className = kind;
    if (style) patch.style.background = style;
    item.append(patch, text);
    box.append(item);
  };
  if (control("colours").value === "size") entry(`|u| from 0 to the largest amplitude${data.bent ? ", its root" : ""}`, "", "scale");
  else {
    data.names.forEach((name, k) => {
      const colour = k < data.meshed ? data.pale[k] : data.colours[k];
      entry(name, `rgb(${colour.join(",")})`, "");
    });
  }
}

let before = null, waiting = false;
function frame(now) {
  waiting = false;
  if (state.playing) {
    if (before !== null) {
      state.phase += ((now - before) / 1000) * 2 * Math.PI * Number(control("speed").value);
      state.phase %= 2 * Math.PI;
      show();
    }
    before = now;
  }
  draw();
  if (state.playing) later();
}
function later() {
  if (!waiting) {
    waiting = true;
    requestAnimationFrame(frame);
  }
}
function show() {
  const degrees = Math.round((state.phase * 180) / Math.PI) % 360;
  control("phase").value = degrees;
  control("degrees").textContent = `${degrees}°`;
}
function play(on) {
  state.playing = on;
  before = null;
  control("play").textContent = on ? "Pause" : "Play";
  later();
}

control("play").addEventListener("click", () => play(!state.playing));
control("phase").addEventListener("input", (event) => {
  play(false);
  state.phase = (Number(event.target.value) * Math.PI) / 180;
  show();
});
control("amplitude").addEventListener("input", (event) => {
  control("times").textContent = `${Number(event.target.value).toFixed(2)} ×`;
  later();
});
control("colours").addEventListener("change", () => { legend(); later(); });
control("reset").addEventListener("click", () => { Object.assign(state, start); later(); });

function turn(dx, dy, panning) {
  if (space && !panning) {
    state.azimuth -= 0.5 * dx;
    state.elevation = Math.max(-90, Math.min(90, state.elevation + 0.5 * dy));
  } else {
    state.x += dx / canvas.clientWidth;
    state.y += dy / canvas.clientHeight;
  }
  later();
}
let held = null;
canvas.addEventListener("pointerdown", (event) => {
  held = [event.clientX, event.clientY];
  canvas.setPointerCapture(event.pointerId);
});
canvas.addEventListener("pointermove", (event) => {
  if (!held) return;
  turn(event.clientX - held[0], event.clientY - held[1], event.shiftKey);
  held = [event.clientX, event.clientY];
});
for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { held = null; });
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  state.zoom = Math.max(0.2, Math.min(20, state.zoom * Math.exp(-event.deltaY / 600)));
  later();
}, { passive: false });
canvas.addEventListener("keydown", (event) => {
  const step = { ArrowLeft: [-12, 0], ArrowRight: [12, 0], ArrowUp: [0, -12], ArrowDown: [0, 12] }[event.key];
  if (step) turn(...step, event.shiftKey);
  else if (event.key === " ") play(!state.playing);
  else return;
  event.preventDefault();
});
// A frame that is hidden has no size, and may be told of a model before it is shown.
function fit() {
  if (!data || !canvas.clientWidth) return;
  resize();
  later();
}
window.addEventListener("resize", fit);
new ResizeObserver(fit).observe(canvas);

function begin() {
  Object.assign(start, { elevation: data.elevation, azimuth: data.azimuth });
  Object.assign(state, start);
  resize();
  legend();
  play(state.playing);
}

// A page that has this one in a frame tells it what to play: all of a model, or another mode of the one that it has. It
// is asked once for the viewer, by the first model that has any use for it; until that comes the canvas draws.
let asked = false;
function ask() {
  if (asked || !body.length || !globalThis.WebGL2RenderingContext) return;
  asked = true;
  window.parent.postMessage("stridor-viewer-wanted", "*");
}
function receive(text) {
  const script = document.createElement("script");
  script.textContent = text;
  document.head.append(script);
  if (!data || card || cardless || !globalThis.stridorViewer) return;
  open();
  if (!card) return;
  card.load(model());
  moved = seen = size = null;
  later();
}
window.addEventListener("message", (event) => {
  if (event.source !== window.parent || window.parent === window || !event.data) return;
  const { geometry, motion, title, growth, unstable, dark, viewer } = event.data;
  if (viewer) {
    receive(viewer);
    return;
  }
  if (dark !== undefined) {
    document.documentElement.classList.toggle("dark", dark);
    paper = dark ? 0xff221d1b : 0xffffffff;
    card?.paper(colourOf(paper));
    if (data) later();
  }
  if (title !== undefined) {
    document.querySelector("h1").textContent = title;
    control("growth").textContent = growth;
    control("growth").className = unstable ? "unstable" : "stable";
    canvas.setAttribute("aria-label", `${title}, in motion; ${growth}`);
  }
  if (geometry) {
    const first = !data || data.dimension !== geometry.dimension;
    load(geometry);
    if (first) begin();
    else legend();
    ask();
  } else if (motion && data) change(motion);
  if (data) {
    legend();
    later();
  }
});

const given = JSON.parse(document.getElementById("data").textContent);
if (given) {
  load(given);
  begin();
} else window.parent.postMessage("stridor-mode-ready", "*");
