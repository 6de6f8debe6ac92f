"use strict";
// Marks on a frame, saved as they are (schema track.marks/1). Pixel (0, 0) is the centre of the top-left pixel.
(() => {
const data = JSON.parse(document.getElementById("data").textContent);
const [width, height] = data.image_size_px;
// The calibration to begin with, and where its origin and axes are in the picture.
const file = data.calib, start = data.start;
const el = (id) => document.getElementById(id);
const SVG = "http://www.w3.org/2000/svg";

// ---- what is marked ----

const fileScale = !file.scale || file.scale.from_px ? "ruler" : file.scale.ball ? "ball" : file.scale.gravity ? "gravity" : "keep";
const ruler = file.scale && file.scale.from_px ? file.scale : {};
const floorLine = (file.floor && file.floor.line_px) || null;
const level = Math.round(start.floor_px[1]);

const state = {
  scale: fileScale,
  from: ruler.from_px ? ruler.from_px.slice() : [0.25 * width, 0.8 * height].map(Math.round),
  to: ruler.to_px ? ruler.to_px.slice() : [0.75 * width, 0.8 * height].map(Math.round),
  floor: start.floor_px,
  edge: start.edge_px,
  lineFrom: floorLine ? floorLine[0].slice() : [0.35 * width, level],
  lineTo: floorLine ? floorLine[1].slice() : [0.85 * width, level],
  floorOn: start.has_origin,
  edgeOn: start.has_edge,
  lineOn: !!floorLine,
  // Ends that nobody moved stay in the file as they are, with their uncertainty.
  lineMoved: !floorLine,
};

const apart = ([a, b], [c, d]) => Math.hypot(a - c, b - d);

// "Up" in the picture, for the lines through floor and edge: the ruler's where it tells, else the file's.
function up() {
  const held = el("held").value, length = apart(state.from, state.to);
  if (state.scale !== "ruler" || !held || !(length > 0)) return start.up_px;
  const d = [0, 1].map((i) => (state.to[i] - state.from[i]) / length);
  const axis = held === "upright" ? d : [-d[1], d[0]];
  const sign = axis[0] * start.up_px[0] + axis[1] * start.up_px[1] < 0 ? -1 : 1;
  return axis.map((x) => x * sign);
}

// ---- the file ----

// What stands in a field: null for nothing, NaN for what is no number. A decimal comma is a point; where a comma may as well part
// thousands, the writer has to say.
const AMBIGUOUS = /^[+-]?[1-9]\d{0,2},\d{3}$/;
const number = (id) => {
  const text = el(id).value.trim();
  if (text === "") return null;
  if (AMBIGUOUS.test(text) || !/^[+-]?(\d+[.,]?\d*|[.,]\d+)(e[+-]?\d+)?$/i.test(text)) return NaN;
  return Number(text.replace(",", "."));
};
const rounded = (p) => p.map((x) => Math.round(100 * x) / 100);

function problems() {
  const found = [];
  const positive = (id, what) => {
    const x = number(id), text = el(id).value.trim();
    if (AMBIGUOUS.test(text)) {
      found.push(`${what}: "${text}" may be ${text.replace(",", ".")} or ${text.replace(",", "")}; write one of them.`);
    } else if (Number.isNaN(x)) {
      found.push(`${what}: "${text}" is no number; write it as 2.32 or 2,32.`);
    } else if (x !== null && !(x > 0)) found.push(`${what} must be above 0.`);
    return x;
  };
  if (state.scale === "ruler") {
    if (apart(state.from, state.to) < 2) found.push("The two ends of the ruler are the same point: drag them as far apart as the frame allows.");
    if (positive("length", "The length") === null) found.push("Give the length between the two marks, in metres.");
    positive("length-std", "The length's uncertainty");
    positive("point-std", "The marks' uncertainty");
  }
  const radius = positive("radius", "The radius");
  if (state.scale === "ball" && radius === null) found.push("The ball is the scale: give its radius, in metres.");
  positive("mass", "The mass");
  positive("rate", "The frame rate");
  if (state.edgeOn && !state.floorOn) found.push("The launch edge needs the floor too: it has no height of its own.");
  if (state.lineOn && apart(...[state.lineFrom, state.lineTo].map(rounded)) < 10) {
    found.push("The two ends of the line along the floor are nearly one point: drag them as far apart as the frame shows the floor.");
  }
  return found;
}

function result() {
  const line = [state.lineFrom, state.lineTo];
  const scales = {
    ruler: () => ({ from_px: rounded(state.from), to_px: rounded(state.to), length_m: number("length"), length_std_m: number("length-std") }),
    ball: () => ({ ball: true }),
    gravity: () => ({ gravity: true }),
    keep: () => null,
  };
  const all = {
    schema: "track.marks/1",
    image_size_px: [width, height],
    scale: scales[state.scale](),
    held: state.scale === "ruler" ? el("held").value || null : null,
    floor_px: state.floorOn ? rounded(state.floor) : null,
    edge_px: state.edgeOn ? rounded(state.edge) : null,
    floor_line_px: state.lineOn ? (state.lineMoved ? line.map(rounded) : line) : null,
    point_std_px: number("point-std"),
    ball_radius_m: number("radius"),
    ball_mass_kg: number("mass"),
    frame_rate_hz: number("rate"),
    base: file.scale ? file : null,
  };
  return Object.fromEntries(Object.entries(all).filter(([, value]) => value !== null));
}

// Rows of numbers on one line, as people write them.
const text = (marks) =>
  JSON.stringify(marks, null, 2).replace(/\[\s+([^\[\]{}]*?)\s+\]/g, (_, inner) => `[${inner.replace(/\s*\n\s*/g, " ")}]`) + "\n";

// ---- drawing ----

const NAMES = { from: "from", to: "to", lineFrom: "floor line", lineTo: "floor line, other end", floor: "floor", edge: "launch edge" };
const shown = (name) =>
  name === "floor" ? state.floorOn
    : name === "edge" ? state.edgeOn
    : name.startsWith("line") ? state.lineOn
    : state.scale === "ruler";

function make(tag, attributes, parent) {
  const node = document.createElementNS(SVG, tag);
  Object.entries(attributes).forEach(([k, v]) => node.setAttribute(k, v));
  parent.appendChild(node);
  return node;
}

// ---- the part of the picture that is shown ----

const view = { u: -0.5, v: -0.5, width };
const MOST_ZOOM = 40;

// Shows the part with this corner and width; the whole picture at most, and nothing beside it.
function look(u, v, wide) {
  view.width = Math.min(Math.max(wide, width / MOST_ZOOM), width);
  const part = view.width / width, whole = part > 0.999;
  view.u = Math.min(Math.max(u, -0.5), width - 0.5 - view.width);
  view.v = Math.min(Math.max(v, -0.5), height - 0.5 - part * height);
  const stage = el("stage");
  stage.setAttribute("viewBox", `${view.u} ${view.v} ${view.width} ${part * height}`);
  // A finger on the whole picture scrolls the page; on a part of it, it pans.
  stage.style.touchAction = whole ? "pan-y" : "none";
  stage.classList.toggle("near", !whole);
  el("zoom-out").disabled = el("zoom-all").disabled = whole;
  el("zoom-in").disabled = view.width <= width / MOST_ZOOM;
  draw();
}

// Nearer by a factor, with one pixel of the picture staying where it is on the screen.
function zoom(factor, [u, v]) {
  const wide = Math.min(Math.max(view.width / factor, width / MOST_ZOOM), width), kept = wide / view.width;
  look(u - (u - view.u) * kept, v - (v - view.v) * kept, wide);
}

// The pixel about which keys and buttons zoom: the mark that was last in hand, else the middle.
let lastMark = null;
const aim = () =>
  lastMark && shown(lastMark) ? state[lastMark] : [view.u + view.width / 2, view.v + (view.width * height) / width / 2];

function pixelAt({ clientX, clientY }) {
  const at = new DOMPoint(clientX, clientY).matrixTransform(el("stage").getScreenCTM().inverse());
  return [at.x, at.y];
}

function listenToStage() {
  const stage = el("stage"), fingers = new Map();
  const middle = () => {
    const all = [...fingers.values()];
    return [0, 1].map((i) => all.reduce((sum, p) => sum + p[i], 0) / all.length);
  };
  const spread = () => {
    const [a, b] = [...fingers.values()];
    return b ? Math.hypot(a[0] - b[0], a[1] - b[1]) : 0;
  };
  stage.addEventListener("wheel", (event) => {
    const farther = event.deltaY > 0;
    // At the whole picture the wheel scrolls the page on.
    if (farther && view.width >= 0.999 * width) return;
    event.preventDefault();
    zoom(farther ? 1 / 1.25 : 1.25, pixelAt(event));
  }, { passive: false });
  stage.addEventListener("pointerdown", (event) => {
    if (event.target.closest("[data-mark]")) return;
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    try {
      stage.setPointerCapture(event.pointerId);
    } catch (error) {
      // A pointer that is gone already.
    }
  });
  stage.addEventListener("pointermove", (event) => {
    if (!fingers.has(event.pointerId)) return;
    const [before, apartBefore] = [middle(), spread()];
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    const [after, apartAfter] = [middle(), spread()];
    const s = unit();
    look(view.u - (after[0] - before[0]) * s, view.v - (after[1] - before[1]) * s, view.width);
    if (apartBefore > 0 && apartAfter > 0) zoom(apartAfter / apartBefore, pixelAt({ clientX: after[0], clientY: after[1] }));
  });
  for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
    stage.addEventListener(end, (event) => fingers.delete(event.pointerId));
  }
  stage.addEventListener("keydown", (event) => {
    const factor = { "+": 1.5, "=": 1.5, "-": 1 / 1.5 }[event.key];
    if (factor) zoom(factor, aim());
    else if (event.key === "0") look(0, 0, width);
    else if (event.target === stage && event.key.startsWith("Arrow")) {
      const step = 0.1 * view.width, way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
      look(view.u + step * way[0], view.v + step * way[1], view.width);
    } else return;
    event.preventDefault();
  });
  el("zoom-in").addEventListener("click", () => zoom(1.5, aim()));
  el("zoom-out").addEventListener("click", () => zoom(1 / 1.5, aim()));
  el("zoom-all").addEventListener("click", () => look(0, 0, width));
}

// A screen pixel in pixels of the picture.
const unit = () => {
  const matrix = el("stage").getScreenCTM();
  return matrix && matrix.a > 0 ? 1 / matrix.a : 1;
};

const handles = {};
const lines = {};

function build() {
  const stage = el("stage"), marks = el("marks");
  for (const name of ["ruler", "line", "floor", "edge"]) {
    const of = { ruler: "from", line: "lineFrom" }[name] || name;
    lines[name] = [make("polyline", { class: "line under" }, marks), make("polyline", { class: `line ${of}` }, marks)];
  }
  for (const name of Object.keys(NAMES)) {
    const group = make("g", { class: `mark ${name}`, tabindex: 0, role: "slider", "aria-label": NAMES[name], "data-mark": name }, marks);
    group.hold = make("circle", {}, group);
    group.rings = [make("path", { class: "ring under" }, group), make("path", { class: "ring" }, group)];
    group.label = make("text", {}, group);
    group.label.textContent = NAMES[name];
    handles[name] = group;
    listen(group, name);
  }
}

// The straight line through a mark across "up" (or along it); the program's picture of the marks shows the lens's bend.
function through([u, v], across) {
  const [a, b] = up(), reach = width + height;
  const [du, dv] = across ? [-b * reach, a * reach] : [a * reach, b * reach];
  return `${u - du},${v - dv} ${u + du},${v + dv}`;
}

function draw() {
  const s = unit();
  for (const [name, group] of Object.entries(handles)) {
    group.style.display = shown(name) ? "" : "none";
    const [u, v] = state[name];
    group.setAttribute("transform", `translate(${u} ${v})`);
    group.setAttribute("aria-valuetext", `${u.toFixed(1)}, ${v.toFixed(1)} px`);
    group.hold.setAttribute("r", 18 * s);
    const r = 11 * s, gap = 4 * s;
    const ring = `M${-r} 0a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0M${-r} 0H${-gap}M${gap} 0H${r}M0 ${-r}V${-gap}M0 ${gap}V${r}`;
    group.rings.forEach((ringNode) => ringNode.setAttribute("d", ring));
    const leftwards = u - view.u > 0.85 * view.width;
    group.label.setAttribute("x", (leftwards ? -14 : 14) * s);
    group.label.setAttribute("y", -12 * s);
    group.label.setAttribute("text-anchor", leftwards ? "end" : "start");
    group.label.setAttribute("font-size", 14 * s);
  }
  const put = (name, points, on) => lines[name].forEach((l) => l.setAttribute("points", on ? points : ""));
  put("ruler", `${state.from} ${state.to}`, state.scale === "ruler");
  put("line", `${state.lineFrom} ${state.lineTo}`, state.lineOn);
  put("floor", state.floorOn ? through(state.floor, true) : "", state.floorOn);
  put("edge", state.edgeOn ? through(state.edge, false) : "", state.edgeOn);
}

function refresh() {
  draw();
  const found = problems();
  el("problems").replaceChildren(...found.map((p) => {
    const li = document.createElement("li");
    li.textContent = p;
    return li;
  }));
  document.querySelectorAll("[data-for]").forEach((p) => { p.hidden = p.dataset.for !== state.scale; });
  el("save").disabled = el("copy").disabled = found.length > 0;
  el("result").textContent = found.length ? "" : text(result());
  el("done").textContent = "";
}

// ---- the loupe ----

const image = new Image();

function loupe(name) {
  const canvas = el("loupe"), context = canvas.getContext("2d");
  if (!name) {
    canvas.style.visibility = "hidden";
    return;
  }
  const [u, v] = state[name], zoom = 10, span = canvas.width / zoom;
  const shrunk = image.naturalWidth / width;
  context.imageSmoothingEnabled = false;
  context.fillStyle = "#222";
  context.fillRect(0, 0, canvas.width, canvas.height);
  // Pixel (0, 0) of the picture covers −0.5 to 0.5.
  const left = u + 0.5 - span / 2, top = v + 0.5 - span / 2;
  context.drawImage(image, left * shrunk, top * shrunk, span * shrunk, span * shrunk, 0, 0, canvas.width, canvas.height);
  const middle = canvas.width / 2;
  for (const [style, line] of [["rgba(0,0,0,.6)", 3], ["#fff", 1]]) {
    context.strokeStyle = style;
    context.lineWidth = line;
    context.beginPath();
    for (const [from, to] of [[0, middle - 10], [middle + 10, canvas.width]]) {
      context.moveTo(from, middle);
      context.lineTo(to, middle);
      context.moveTo(middle, from);
      context.lineTo(middle, to);
    }
    context.rect(middle - 0.5, middle - 0.5, 1, 1);
    context.stroke();
  }
  // Beside the mark, not over it: in the other half (on a narrow screen it has a place of its own).
  canvas.classList.toggle("left", u - view.u > view.width / 2);
  canvas.style.visibility = "visible";
}

// ---- moving ----

function move(name, u, v) {
  const clamp = (x, most) => Math.min(Math.max(x, 0), most - 1);
  state[name] = [clamp(u, width), clamp(v, height)];
  if (name.startsWith("line")) state.lineMoved = true;
  refresh();
  loupe(name);
}

function listen(group, name) {
  let grip = null;
  group.addEventListener("pointerdown", (event) => {
    const [u, v] = pixelAt(event);
    // Where the mark was taken hold of, so that it does not jump.
    grip = [state[name][0] - u, state[name][1] - v];
    try {
      group.setPointerCapture(event.pointerId);
    } catch (error) {
      // A pointer that is gone already.
    }
    group.classList.add("active");
    group.focus({ preventScroll: true });
    loupe(name);
    event.preventDefault();
  });
  group.addEventListener("pointermove", (event) => {
    if (!grip) return;
    const [u, v] = pixelAt(event);
    move(name, u + grip[0], v + grip[1]);
  });
  for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
    group.addEventListener(end, () => {
      grip = null;
      group.classList.remove("active");
    });
  }
  group.addEventListener("keydown", (event) => {
    const step = event.shiftKey ? 10 : event.altKey ? 0.1 : 1;
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!way) return;
    event.preventDefault();
    move(name, state[name][0] + step * way[0], state[name][1] + step * way[1]);
  });
  group.addEventListener("focus", () => {
    lastMark = name;
    loupe(name);
  });
  group.addEventListener("blur", () => loupe(null));
}

// ---- saving ----

function save() {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([el("result").textContent], { type: "application/json" }));
  link.download = data.marks_name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  el("done").textContent = `${data.marks_name} is among your downloads.`;
}

async function copy() {
  try {
    await navigator.clipboard.writeText(el("result").textContent);
  } catch (error) {
    getSelection().selectAllChildren(el("result"));
    document.execCommand("copy");
  }
  el("done").textContent = "Copied.";
}

// ---- the frames ----

function showFrame(index) {
  const frame = data.frames[index];
  image.src = frame.jpeg;
  el("frame").setAttribute("href", frame.jpeg);
  el("frame-name").textContent = frame.name;
}

// How the ruler of the file stood, where its "up" and the uncertainty of that are those of the ruler's marks. With a lens "up" is that of
// the undistorted picture, so that they agree roughly only.
function standOfFile() {
  if (!ruler.from_px || !file.up_px || !file.up_std_deg || !ruler.point_std_px) return "";
  const length = apart(ruler.from_px, ruler.to_px), size = Math.hypot(...file.up_px);
  const [near, alike] = file.lens ? [0.02, 0.03] : [1e-6, 1e-6];
  const std = ((Math.SQRT2 * ruler.point_std_px) / length) * (180 / Math.PI);
  if (!(Math.abs(std / file.up_std_deg - 1) < alike)) return "";
  const [du, dv] = [0, 1].map((i) => (ruler.to_px[i] - ruler.from_px[i]) / length), [a, b] = file.up_px.map((x) => x / size);
  if (Math.abs(du * b - dv * a) < near) return "upright";
  return Math.abs(du * a + dv * b) < near ? "level" : "";
}

function begin() {
  const frame = el("frame");
  [["x", -0.5], ["y", -0.5], ["width", width], ["height", height]].forEach(([k, v]) => frame.setAttribute(k, v));
  const slider = el("frame-slider");
  slider.max = data.frames.length - 1;
  slider.value = Math.floor(data.frames.length / 2);
  el("frames").hidden = data.frames.length < 2;
  slider.addEventListener("input", () => showFrame(Number(slider.value)));
  showFrame(Number(slider.value));
  const fill = (id, value) => { el(id).value = value === null || value === undefined ? "" : value; };
  fill("length", ruler.length_m);
  fill("length-std", ruler.length_std_m);
  fill("point-std", ruler.point_std_px || file.origin_std_px || 1);
  fill("radius", file.ball && file.ball.radius_m);
  fill("mass", file.ball && file.ball.mass_kg);
  fill("rate", file.frame_rate_hz);
  el("keep").hidden = fileScale !== "keep";
  el("form").elements.scale.value = state.scale;
  el("floor-on").checked = state.floorOn;
  el("edge-on").checked = state.edgeOn;
  el("line-on").checked = state.lineOn;
  el("held").value = standOfFile();
  build();
  listenToStage();
  look(0, 0, width);
  el("form").addEventListener("input", () => {
    state.scale = el("form").elements.scale.value;
    state.floorOn = el("floor-on").checked;
    state.edgeOn = el("edge-on").checked;
    state.lineOn = el("line-on").checked;
    refresh();
  });
  el("form").addEventListener("submit", (event) => event.preventDefault());
  el("save").addEventListener("click", save);
  el("copy").addEventListener("click", copy);
  image.addEventListener("load", () => {
    const active = document.activeElement && document.activeElement.dataset.mark;
    if (active) loupe(active);
  });
  window.addEventListener("resize", draw);
  refresh();
}

begin();
})();
