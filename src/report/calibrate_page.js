"use strict";
// Marks on a frame, and the calib.json that follows from them. Pixel (0, 0) is the centre of the top-left pixel.
(() => {
const data = JSON.parse(document.getElementById("data").textContent);
const [width, height] = data.image_size_px;
const file = data.calib;
const el = (id) => document.getElementById(id);
const SVG = "http://www.w3.org/2000/svg";

// ---- the lens, as `track` has it (OpenCV's five coefficients) ----

const lens = file.lens || null;

function distortNormalised([x, y], of) {
  const [k1, k2, p1, p2, k3] = of.distortion;
  const s = x * x + y * y, q = 1 + s * (k1 + s * (k2 + s * k3));
  return [x * q + 2 * p1 * x * y + p2 * (s + 2 * x * x), y * q + p1 * (s + 2 * y * y) + 2 * p2 * x * y];
}

const normalised = ([u, v], of) => {
  const m = of.camera_matrix;
  return [(u - m[0][2]) / m[0][0], (v - m[1][2]) / m[1][1]];
};
const pixel = ([x, y], of) => {
  const m = of.camera_matrix;
  return [m[0][0] * x + m[0][2], m[1][1] * y + m[1][2]];
};

const distort = (p, of = lens) => (of ? pixel(distortNormalised(normalised(p, of), of), of) : p);

// Newton's method; null where it does not come to rest.
function undistort(p, of = lens) {
  if (!of) return p;
  const seen = normalised(p, of);
  let [x, y] = seen;
  for (let i = 0; i < 60; i++) {
    const h = 1e-6;
    const [fx, fy] = distortNormalised([x, y], of);
    const [ax, ay] = distortNormalised([x + h, y], of), [bx, by] = distortNormalised([x, y + h], of);
    const a = (ax - fx) / h, b = (bx - fx) / h, c = (ay - fy) / h, d = (by - fy) / h;
    const det = a * d - b * c, rx = fx - seen[0], ry = fy - seen[1];
    const dx = (d * rx - b * ry) / det, dy = (a * ry - c * rx) / det;
    x -= dx;
    y -= dy;
    if (!(Math.hypot(x, y) < 20)) return null;
    if (Math.hypot(dx, dy) < 1e-12) return pixel([x, y], of);
  }
  return null;
}

// ---- what is marked ----

const scaleOf = (s) => (!s ? "ruler" : s.from_px ? "ruler" : s.ball ? "ball" : s.gravity ? "gravity" : "keep");
const fileScale = scaleOf(file.scale);
const matrix = file.scale && file.scale.world_from_pixel;
const ruler = file.scale && file.scale.from_px ? file.scale : {};
const floorLine = (file.floor && file.floor.line_px) || null;

const state = {
  scale: fileScale,
  from: ruler.from_px ? ruler.from_px.slice() : [0.25 * width, 0.8 * height].map(Math.round),
  to: ruler.to_px ? ruler.to_px.slice() : [0.75 * width, 0.8 * height].map(Math.round),
  floor: null,
  edge: null,
  lineFrom: null,
  lineTo: null,
  floorOn: false,
  edgeOn: false,
  lineOn: !!floorLine,
  // Ends that nobody moved stay in the file as they are, with their uncertainty.
  lineMoved: !floorLine,
};

// "Up" in the undistorted picture, a unit vector.
function up() {
  const given = file.up_px || [0, -1], n = Math.hypot(...given);
  const held = el("held").value;
  if (state.scale !== "ruler" || !held) return given.map((x) => x / n);
  const a = undistort(state.from), b = undistort(state.to);
  if (!a || !b) return given.map((x) => x / n);
  const d = [b[0] - a[0], b[1] - a[1]], l = Math.hypot(...d);
  if (!(l > 0)) return given.map((x) => x / n);
  const axis = held === "upright" ? [d[0] / l, d[1] / l] : [-d[1] / l, d[0] / l];
  const sign = axis[0] * given[0] + axis[1] * given[1] < 0 ? -1 : 1;
  return axis.map((x) => x * sign);
}

// World of an undistorted pixel by the file's homography; its sign does not matter.
function world([u, v], of = matrix) {
  const [x, y, w] = of.map((r) => r[0] * u + r[1] * v + r[2]);
  return [x / w, y / w];
}

function pixelOfWorld([x, y]) {
  const [[a, b, c], [d, e, f], [g, h, i]] = matrix;
  const inverse = [
    [e * i - f * h, c * h - b * i, b * f - c * e],
    [f * g - d * i, a * i - c * g, c * d - a * f],
    [d * h - e * g, b * g - a * h, a * e - b * d],
  ];
  const [u, v, w] = inverse.map((r) => r[0] * x + r[1] * y + r[2]);
  return [u / w, v / w];
}

const keepsMatrix = () => state.scale === "keep" && matrix;

// The pixel at the height of `floor` and the x of `edge`.
function crossing(floor, edge) {
  const f = undistort(floor), e = undistort(edge);
  if (!f || !e) return null;
  if (keepsMatrix()) return distort(pixelOfWorld([world(e)[0], world(f)[1]]));
  const [a, b] = up();
  const right = -b * e[0] + a * e[1], high = a * f[0] + b * f[1];
  return distort([-b * right + a * high, a * right + b * high]);
}

function placeOrigin() {
  let origin = file.origin_px || null;
  if (!origin && matrix && !file.scale.origin_unknown) origin = distort(pixelOfWorld([0, 0]));
  const free = origin || [0.12 * width, 0.92 * height].map(Math.round);
  const [a, b] = up();
  const clamp = (x, most) => Math.min(Math.max(x, 0), most - 1);
  const at = (right, high) => {
    const p = undistort(free) || free;
    const q = distort([p[0] - b * right + a * high, p[1] + a * right + b * high]);
    return [clamp(q[0], width), clamp(q[1], height)];
  };
  // Beside each other, so that both can be taken hold of.
  state.floor = at(0.1 * width, 0);
  state.edge = at(0, 0.12 * height);
  if (matrix && origin) {
    const w = world(undistort(free));
    const u = 0.1 * Math.abs(world([width, height / 2])[0] - world([0, height / 2])[0]);
    state.floor = distort(pixelOfWorld([w[0] + u, w[1]]));
    state.edge = distort(pixelOfWorld([w[0], w[1] + u]));
  }
  const level = Math.round(state.floor[1]);
  [state.lineFrom, state.lineTo] = (floorLine || [[0.35 * width, level], [0.85 * width, level]]).map((p) => p.slice());
  state.floorOn = !!origin;
  state.edgeOn = !!origin && !(file.launch && file.launch.edge_x_m === null);
}

// ---- the file ----

const number = (id) => {
  const text = el(id).value.trim();
  return text === "" ? null : Number(text);
};
const rounded = (p) => p.map((x) => Math.round(100 * x) / 100);

function problems() {
  const found = [];
  const positive = (id, what) => {
    const x = number(id);
    if (x !== null && !(x > 0)) found.push(`${what} must be above 0.`);
    return x;
  };
  if (state.scale === "ruler") {
    const apart = Math.hypot(state.to[0] - state.from[0], state.to[1] - state.from[1]);
    if (apart < 2) found.push("The two ends of the ruler are the same point: drag them as far apart as the frame allows.");
    if (positive("length", "The length") === null) found.push("Give the length between the two marks, in metres.");
    positive("length-std", "The length's uncertainty");
    positive("point-std", "The marks' uncertainty");
  }
  const radius = positive("radius", "The radius");
  if (state.scale === "ball" && radius === null) found.push("The ball is the scale: give its radius, in metres.");
  positive("mass", "The mass");
  positive("rate", "The frame rate");
  if (state.edgeOn && !state.floorOn) found.push("The launch edge needs the floor too: it has no height of its own.");
  if (state.floorOn && !crossing(state.floor, state.edge)) found.push("The lens has no place for floor or edge there.");
  if (state.lineOn) {
    const [a, b] = [state.lineFrom, state.lineTo].map(rounded);
    if (Math.hypot(b[0] - a[0], b[1] - a[1]) < 10) found.push("The two ends of the line along the floor are nearly one point: drag them as far apart as the frame shows the floor.");
    if (!undistort(a) || !undistort(b)) found.push("The lens has no place for the line along the floor there.");
  }
  return found;
}

function result() {
  const calib = JSON.parse(JSON.stringify(file));
  const put = (object, key, value) => {
    if (value === null || value === undefined) delete object[key];
    else object[key] = value;
  };
  calib.schema = "track.calib/1";
  calib.image_size_px = [width, height];
  const std = number("point-std");
  if (state.scale === "ruler") {
    calib.scale = { from_px: rounded(state.from), to_px: rounded(state.to), length_m: number("length") };
    put(calib.scale, "length_std_m", number("length-std"));
    put(calib.scale, "point_std_px", std);
    if (el("held").value) {
      const a = undistort(state.from), b = undistort(state.to);
      calib.up_px = up();
      if (a && b && std) calib.up_std_deg = (Math.SQRT2 * std / Math.hypot(a[0] - b[0], a[1] - b[1])) * 180 / Math.PI;
    }
  } else if (state.scale === "ball") calib.scale = { ball: true };
  else if (state.scale === "gravity") calib.scale = { gravity: true };
  origin(calib, std, put);
  const floor = Object.assign({}, calib.floor || {});
  if (!state.lineOn) {
    delete floor.line_px;
    delete floor.line_std_px;
  } else if (state.lineMoved) {
    floor.line_px = [rounded(state.lineFrom), rounded(state.lineTo)];
    put(floor, "line_std_px", std);
  }
  put(calib, "floor", Object.keys(floor).length ? floor : null);
  // Deviations of a homography that is gone have nothing to refer to.
  if (!keepsMatrix() && calib.deviations) {
    if (calib.lens) calib.deviations.forEach((d) => delete d.world_from_pixel);
    else delete calib.deviations;
  }
  const ball = Object.assign({}, calib.ball || {});
  put(ball, "radius_m", number("radius"));
  put(ball, "mass_kg", number("mass"));
  put(calib, "ball", Object.keys(ball).length ? ball : null);
  put(calib, "frame_rate_hz", number("rate"));
  return calib;
}

const combined = (a, b, sign) => a.map((row, i) => row.map((x, j) => x + sign * b[i][j]));

// The lens off by a deviation's nine numbers.
function lensOff(deviation) {
  const d = deviation.lens;
  if (!lens || !d) return lens;
  const [[fx, , cx], [, fy, cy]] = lens.camera_matrix;
  return {
    camera_matrix: [[fx + d[0], 0, cx + d[2]], [0, fy + d[1], cy + d[3]], [0, 0, 1]],
    distortion: lens.distortion.map((k, i) => k + d[4 + i]),
  };
}

// The homography with its origin at the height of the floor and the x of the edge.
function withOrigin(m, of) {
  const f = world(undistort(state.floor, of), m), e = state.edgeOn ? world(undistort(state.edge, of), m) : f;
  return [m[0].map((x, j) => x - e[0] * m[2][j]), m[1].map((x, j) => x - f[1] * m[2][j]), m[2].slice()];
}

function origin(calib, std, put) {
  const launch = Object.assign({}, calib.launch || {});
  if (keepsMatrix()) {
    delete calib.up_px;
    if (state.floorOn) {
      const moved = withOrigin(matrix, lens);
      calib.scale = Object.assign({}, file.scale, { world_from_pixel: moved });
      delete calib.scale.origin_unknown;
      for (const d of calib.deviations || []) {
        if (!d.world_from_pixel) continue;
        // However lens and matrix are off, the marks stay where they are in the picture.
        const off = withOrigin(combined(matrix, d.world_from_pixel, 1), lensOff(d));
        d.world_from_pixel = combined(off, moved, -1);
      }
      put(calib, "origin_std_px", std || file.origin_std_px);
    } else {
      calib.scale = Object.assign({}, file.scale, { origin_unknown: true });
      delete calib.origin_std_px;
    }
  } else if (state.floorOn) {
    const at = crossing(state.floor, state.edgeOn ? state.edge : state.floor);
    put(calib, "origin_px", at ? rounded(at) : null);
    put(calib, "origin_std_px", at ? std : null);
  } else {
    delete calib.origin_px;
    delete calib.origin_std_px;
  }
  if (!state.floorOn) delete launch.edge_x_m;
  else launch.edge_x_m = state.edgeOn ? launch.edge_x_m || 0 : null;
  put(calib, "launch", Object.keys(launch).length ? launch : null);
}

// Rows of numbers on one line, as people write them.
const text = (calib) =>
  JSON.stringify(calib, null, 2).replace(/\[\s+([^\[\]{}]*?)\s+\]/g, (_, inner) => `[${inner.replace(/\s*\n\s*/g, " ")}]`) + "\n";

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

// A screen pixel in pixels of the picture.
const unit = () => {
  const matrix = el("stage").getScreenCTM();
  return matrix && matrix.a > 0 ? 1 / matrix.a : 1;
};

const handles = {};
const lines = {};

function build() {
  const stage = el("stage"), marks = el("marks");
  stage.setAttribute("viewBox", `-0.5 -0.5 ${width} ${height}`);
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

// The line through a mark along `right` (or up), bent as the lens bends it.
function through(mark, across) {
  const p = undistort(mark);
  if (!p) return "";
  const points = [];
  for (let i = -30; i <= 30; i++) {
    const t = (i / 30) * 1.2 * Math.max(width, height);
    let q;
    if (keepsMatrix()) {
      const w = world(p), reach = Math.abs(world([width, height / 2])[0] - world([0, height / 2])[0]);
      const s = (i / 30) * 1.2 * reach;
      q = distort(pixelOfWorld(across ? [w[0] + s, w[1]] : [w[0], w[1] + s]));
    } else {
      const [a, b] = up();
      q = distort(across ? [p[0] - b * t, p[1] + a * t] : [p[0] + a * t, p[1] + b * t]);
    }
    const near = q[0] > -0.1 * width && q[0] < 1.1 * width && q[1] > -0.1 * height && q[1] < 1.1 * height;
    if (near) points.push(q.map((x) => x.toFixed(2)).join(","));
  }
  return points.join(" ");
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
    const leftwards = u > 0.85 * width;
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

function derived() {
  if (state.scale !== "ruler") return "";
  const a = undistort(state.from), b = undistort(state.to), length = number("length");
  if (!a || !b || !(length > 0)) return "";
  const px = Math.hypot(a[0] - b[0], a[1] - b[1]), std = number("point-std") || 0, lengthStd = number("length-std") || 0;
  const relative = Math.hypot((Math.SQRT2 * std) / px, lengthStd / length);
  const q = (1000 * length) / px;
  return `${px.toFixed(1)} px are ${length} m: ${q.toPrecision(5)} mm a pixel, ± ${(100 * relative).toPrecision(2)} %. ` +
    `Every length and speed will be uncertain by this.`;
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
  el("calib").textContent = found.length ? "" : text(result());
  el("derived").textContent = found.length ? "" : derived();
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
  canvas.classList.toggle("left", u > width / 2);
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
  const place = (event) => {
    const stage = el("stage");
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(stage.getScreenCTM().inverse());
    return [at.x, at.y];
  };
  group.addEventListener("pointerdown", (event) => {
    const [u, v] = place(event);
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
    const [u, v] = place(event);
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
  group.addEventListener("focus", () => loupe(name));
  group.addEventListener("blur", () => loupe(null));
}

// ---- saving ----

function save() {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([el("calib").textContent], { type: "application/json" }));
  link.download = data.calib_name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  el("done").textContent = `${data.calib_name} is among your downloads.`;
}

async function copy() {
  try {
    await navigator.clipboard.writeText(el("calib").textContent);
  } catch (error) {
    getSelection().selectAllChildren(el("calib"));
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
  placeOrigin();
  el("keep").hidden = fileScale !== "keep";
  el("form").elements.scale.value = state.scale;
  el("floor-on").checked = state.floorOn;
  el("edge-on").checked = state.edgeOn;
  el("line-on").checked = state.lineOn;
  build();
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
