"use strict";
// What a person says of a recording, saved as it is (schema track.edits/1). Pixel (0, 0) is the centre of the top-left pixel.
(() => {
const data = JSON.parse(document.getElementById("data").textContent);
const [width, height] = data.image_size_px;
const frames = data.times_s.length;
const result = data.result;
const el = (id) => document.getElementById(id);
const SVG = "http://www.w3.org/2000/svg";
const COLOURS = { used: "#4cd07d", unused: "#ffb000", thing: "#5fb8ff", said: "#ff5fd2", region: "#ffffff" };

// ---- what the recording shows ----

// Each frame's things, points and neighbourhoods.
const by = (list, frame) => {
  const all = Array.from({ length: frames }, () => []);
  for (const item of list) if (item[frame] < frames) all[item[frame]].push(item);
  return all;
};
const things = by(data.things, "frame");
const points = by(data.points, "frame");
const crops = by(data.crops, "frame");

const pictures = new Map();
function picture(jpeg) {
  let image = pictures.get(jpeg);
  if (!image) {
    image = new Image();
    image.onload = () => draw();
    image.src = "data:image/jpeg;base64," + jpeg;
    pictures.set(jpeg, image);
  }
  return image.complete && image.naturalWidth ? image : null;
}
function still(frame) {
  let best = null;
  for (const s of data.stills) if (!best || Math.abs(s.frame - frame) < Math.abs(best.frame - frame)) best = s;
  return best;
}

// ---- what the person says ----

const before = data.edits || {};
const edits = {
  range: before.time_range_s ? before.time_range_s.slice() : null,
  region: before.region_px ? before.region_px.slice() : null,
  ball: before.ball ? { ...before.ball } : null,
  excluded: new Set(before.exclude_frames || []),
  points: new Map((before.points || []).map((p) => [p.frame, { ...p }])),
  denied: (before.not_impacts_s || []).slice(),
};
const rounded = (x, digits) => Number(x.toFixed(digits));

function file() {
  const out = { schema: "track.edits/1" };
  if (data.sha256) out.video_sha256 = data.sha256;
  if (edits.range) out.time_range_s = edits.range.map((t) => rounded(t, 6));
  if (edits.region) out.region_px = edits.region.map((x) => rounded(x, 1));
  if (edits.ball) out.ball = edits.ball;
  if (edits.excluded.size) out.exclude_frames = [...edits.excluded].sort((a, b) => a - b);
  if (edits.points.size) out.points = [...edits.points.values()].sort((a, b) => a.frame - b.frame);
  if (edits.denied.length) out.not_impacts_s = edits.denied.slice().sort((a, b) => a - b);
  return out;
}

// ---- where the person looks ----

const impacts = result ? (result.bounces || []).map((b) => b.time_s.value) : [];
// Where the ball, or else the thing that moves most, is first seen.
const first = data.points[0] || data.things.find((t) => t.track === data.moving[0]) || data.things[0];
let now = first ? first.frame : 0;
let mode = "look";
let playing = null;
const stage = el("stage");
stage.style.aspectRatio = `${width} / ${height}`;
// The stage's pixel of the frame's (0, 0), and how many of its pixels a pixel of the frame is.
const view = { x: 0, y: 0, scale: 1 };
const ratio = window.devicePixelRatio || 1;

function fit() {
  const w = stage.clientWidth || 800, h = stage.clientHeight || 450;
  stage.width = Math.round(w * ratio);
  stage.height = Math.round(h * ratio);
  view.scale = Math.min(stage.width / width, stage.height / height);
  view.x = 0.5 * (stage.width - view.scale * (width - 1));
  view.y = 0.5 * (stage.height - view.scale * (height - 1));
}
const toStage = (u, v) => [view.x + u * view.scale, view.y + v * view.scale];
function toFrame(event) {
  const box = stage.getBoundingClientRect();
  const x = ((event.clientX - box.left) / box.width) * stage.width, y = ((event.clientY - box.top) / box.height) * stage.height;
  return [(x - view.x) / view.scale, (y - view.y) / view.scale];
}
function zoom(factor, at) {
  const [u, v] = at;
  const [x, y] = toStage(u, v);
  view.scale = Math.min(60, Math.max(0.05, view.scale * factor));
  view.x = x - u * view.scale;
  view.y = y - v * view.scale;
  draw();
}

// ---- drawing ----

function paint(g, x, y, scale, frame) {
  // The whole frame, small, and what is kept of it at full size.
  const whole = still(frame);
  if (whole) {
    const image = picture(whole.jpeg);
    g.imageSmoothingEnabled = true;
    if (image) g.drawImage(image, x - 0.5 * scale, y - 0.5 * scale, width * scale, height * scale);
  }
  g.imageSmoothingEnabled = scale < 4;
  for (const c of crops[frame]) {
    const image = picture(c.jpeg);
    if (image) g.drawImage(image, x + (c.u - 0.5) * scale, y + (c.v - 0.5) * scale, c.width * scale, c.height * scale);
  }
}
function ring(g, x, y, radius, colour, thick) {
  for (const [style, w] of [["rgb(0 0 0 / 55%)", thick + 2], [colour, thick]]) {
    g.strokeStyle = style;
    g.lineWidth = w;
    g.beginPath();
    g.arc(x, y, Math.max(radius, 2), 0, 2 * Math.PI);
    g.stroke();
  }
}
function cross(g, x, y, arm, colour) {
  for (const [style, w] of [["rgb(0 0 0 / 55%)", 3], [colour, 1.5]]) {
    g.strokeStyle = style;
    g.lineWidth = w;
    g.beginPath();
    g.moveTo(x - arm, y); g.lineTo(x + arm, y);
    g.moveTo(x, y - arm); g.lineTo(x, y + arm);
    g.stroke();
  }
}
// What lies over a frame drawn at (x, y) with this scale.
function over(g, x, y, scale, frame) {
  const at = (u, v) => [x + u * scale, y + v * scale];
  for (const t of things[frame]) ring(g, ...at(t.u, t.v), t.r * scale, COLOURS.thing, 1);
  for (const p of points[frame]) {
    cross(g, ...at(p.u, p.v), Math.max(5, 0.35 * (data.radius_px || 8) * scale), p.used ? COLOURS.used : COLOURS.unused);
  }
  const said = edits.points.get(frame);
  if (said) cross(g, ...at(said.u_px, said.v_px), 12, COLOURS.said);
  if (edits.ball && edits.ball.frame === frame) {
    ring(g, ...at(...edits.ball.centre_px), 1.3 * (edits.ball.radius_px || data.radius_px || 8) * scale, COLOURS.said, 3);
  }
}
function drawStage() {
  const g = stage.getContext("2d");
  g.setTransform(1, 0, 0, 1, 0, 0);
  g.fillStyle = "#222";
  g.fillRect(0, 0, stage.width, stage.height);
  paint(g, view.x, view.y, view.scale, now);
  // The path: where the ball is in all frames.
  for (const p of data.points) {
    const [x, y] = toStage(p.u, p.v);
    g.fillStyle = edits.excluded.has(p.frame) ? "#ff4040" : p.used ? COLOURS.used : COLOURS.unused;
    g.fillRect(x - 1.5, y - 1.5, 3, 3);
  }
  over(g, view.x, view.y, view.scale, now);
  const drawn = dragged && dragged.region ? dragged.region : edits.region;
  if (drawn) {
    const [x0, y0] = toStage(drawn[0], drawn[1]), [x1, y1] = toStage(drawn[2], drawn[3]);
    g.strokeStyle = COLOURS.region;
    g.setLineDash([8, 6]);
    g.lineWidth = 2;
    g.strokeRect(x0, y0, x1 - x0, y1 - y0);
    g.setLineDash([]);
  }
  if (edits.excluded.has(now)) {
    g.strokeStyle = "#ff4040";
    g.lineWidth = 6;
    g.strokeRect(3, 3, stage.width - 6, stage.height - 6);
  }
}
const STRIP = 9;
const strip = Array.from({ length: STRIP }, (_, i) => {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 132;
  canvas.addEventListener("click", () => go(now + i - (STRIP - 1) / 2));
  el("strip").append(canvas);
  return canvas;
});
function middle(frame) {
  const said = edits.points.get(frame);
  if (said) return [said.u_px, said.v_px];
  if (points[frame].length) return [points[frame][0].u, points[frame][0].v];
  if (crops[frame].length) return [crops[frame][0].u + crops[frame][0].width / 2, crops[frame][0].v + crops[frame][0].height / 2];
  return null;
}
function drawStrip() {
  strip.forEach((canvas, i) => {
    const frame = now + i - (STRIP - 1) / 2;
    const g = canvas.getContext("2d");
    g.fillStyle = "#222";
    g.fillRect(0, 0, canvas.width, canvas.height);
    canvas.className = (i === (STRIP - 1) / 2 ? "now" : "") + (edits.excluded.has(frame) ? " out" : "");
    canvas.title = frame >= 0 && frame < frames ? `frame ${frame}` : "";
    const at = frame >= 0 && frame < frames && middle(frame);
    if (!at) return;
    const scale = canvas.width / Math.max(40, 5 * (data.radius_px || 8));
    const x = canvas.width / 2 - at[0] * scale, y = canvas.height / 2 - at[1] * scale;
    paint(g, x, y, scale, frame);
    over(g, x, y, scale, frame);
  });
}

// ---- plots ----

const inMetres = data.points.some((p) => p.x !== null);
const main = data.points.length ? data.points : data.things.filter((t) => data.moving.includes(t.track));
const plotted = inMetres
  ? [
      { name: "x / m", of: (p) => p.x },
      { name: data.second_axis + " / m", of: (p) => p.z },
      { name: "residual of x / mm", of: (p) => (p.rx === null ? null : 1e3 * p.rx) },
      { name: "residual of " + data.second_axis + " / mm", of: (p) => (p.rz === null ? null : 1e3 * p.rz) },
    ]
  : [
      { name: "u / px", of: (p) => p.u },
      { name: "v / px (down)", of: (p) => p.v },
    ];
const PLOT = { w: 560, h: inMetres ? 128 : 200, left: 58, right: 8, top: 16, bottom: 20 };
const times = data.times_s;
const shown = main.map((p) => times[p.frame]);
const span = shown.length ? [Math.min(...shown), Math.max(...shown)] : [0, times[frames - 1] || 1];
const margin = 0.03 * (span[1] - span[0] || 1);
span[0] -= margin;
span[1] += margin;
const timeX = (t) => PLOT.left + ((t - span[0]) / (span[1] - span[0])) * (PLOT.w - PLOT.left - PLOT.right);
const xTime = (x) => span[0] + ((x - PLOT.left) / (PLOT.w - PLOT.left - PLOT.right)) * (span[1] - span[0]);
function node(parent, name, attributes, text) {
  const n = document.createElementNS(SVG, name);
  for (const [k, v] of Object.entries(attributes)) n.setAttribute(k, v);
  if (text !== undefined) n.textContent = text;
  parent.append(n);
  return n;
}
function steps(from, to, most) {
  const rough = (to - from) / most || 1, ten = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((m) => m * ten).find((s) => s >= rough);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const out = [];
  for (let x = Math.ceil(from / step) * step; x <= to + 1e-9 * step; x += step) out.push([x, x.toFixed(digits)]);
  return out;
}
const axes = plotted.map((p) => {
  const svg = node(el("plots"), "svg", { viewBox: `0 0 ${PLOT.w} ${PLOT.h}`, role: "img", "aria-label": p.name });
  const values = main.map(p.of).filter((x) => x !== null && Number.isFinite(x));
  // A few far points must not press the rest flat.
  values.sort((a, b) => a - b);
  const cut = (part) => values[Math.round(part * (values.length - 1))] || 0;
  const isResidual = p.name.startsWith("residual");
  let [low, high] = isResidual ? [cut(0.02), cut(0.98)] : [cut(0), cut(1)];
  const room = 0.12 * (high - low) || 1;
  low -= room;
  high += room;
  const y = (x) => PLOT.h - PLOT.bottom - ((Math.min(high, Math.max(low, x)) - low) / (high - low)) * (PLOT.h - PLOT.top - PLOT.bottom);
  node(svg, "text", { x: PLOT.left, y: 11 }, p.name);
  for (const [value, text] of steps(low, high, 4)) {
    node(svg, "line", { x1: PLOT.left, x2: PLOT.w - PLOT.right, y1: y(value), y2: y(value), stroke: "currentColor", "stroke-opacity": 0.15 });
    node(svg, "text", { x: PLOT.left - 5, y: y(value) + 4, "text-anchor": "end" }, text);
  }
  for (const [value, text] of steps(span[0], span[1], 6)) {
    node(svg, "text", { x: timeX(value), y: PLOT.h - 5, "text-anchor": "middle" }, text);
  }
  const range = node(svg, "rect", { y: PLOT.top, height: PLOT.h - PLOT.top - PLOT.bottom, fill: "currentColor", "fill-opacity": 0.09 });
  for (const t of impacts) node(svg, "line", { x1: timeX(t), x2: timeX(t), y1: PLOT.top, y2: PLOT.h - PLOT.bottom, stroke: "#9c1c1c", "stroke-dasharray": "3 3" });
  const dots = main.map((m) => {
    const value = p.of(m);
    if (value === null || !Number.isFinite(value)) return null;
    return [m, node(svg, "circle", { cx: timeX(times[m.frame]), cy: y(value), r: 2.2 })];
  }).filter(Boolean);
  const cursor = node(svg, "line", { y1: PLOT.top, y2: PLOT.h - PLOT.bottom, stroke: "#ff5fd2", "stroke-width": 1.5 });
  let from = null, moved = false;
  const at = (event) => {
    const box = svg.getBoundingClientRect();
    return xTime(((event.clientX - box.left) / box.width) * PLOT.w);
  };
  svg.addEventListener("pointerdown", (event) => { from = at(event); moved = false; if (event.pointerId) svg.setPointerCapture(event.pointerId); });
  svg.addEventListener("pointermove", (event) => {
    if (from === null) return;
    const to = at(event);
    moved = moved || Math.abs(timeX(to) - timeX(from)) > 6;
    if (moved) { edits.range = [Math.min(from, to), Math.max(from, to)]; draw(); }
  });
  svg.addEventListener("pointerup", (event) => {
    if (from !== null && !moved) go(nearest(at(event)));
    from = null;
    draw();
  });
  return { range, cursor, dots };
});
function nearest(t) {
  let best = 0;
  times.forEach((x, i) => { if (Math.abs(x - t) < Math.abs(times[best] - t)) best = i; });
  return best;
}
function drawPlots() {
  for (const { range, cursor, dots } of axes) {
    const [a, b] = edits.range || [0, 0];
    range.setAttribute("x", timeX(Math.max(span[0], a)));
    range.setAttribute("width", edits.range ? Math.max(0, timeX(Math.min(span[1], b)) - timeX(Math.max(span[0], a))) : 0);
    const x = timeX(times[now]);
    cursor.setAttribute("x1", x);
    cursor.setAttribute("x2", x);
    for (const [m, dot] of dots) {
      const out = edits.excluded.has(m.frame) || (edits.range && (times[m.frame] < a || times[m.frame] > b));
      dot.setAttribute("fill", out ? "#d03030" : m.used === false ? "#c98600" : "#12a05a");
      dot.setAttribute("fill-opacity", out ? 0.5 : 1);
    }
  }
}

// ---- words ----

function entry(list, text, undo) {
  const li = document.createElement("li");
  li.textContent = text;
  if (undo) {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = "take back";
    button.addEventListener("click", () => { undo(); draw(); });
    li.append(button);
  }
  list.append(li);
}
function drawWords() {
  const said = el("said");
  said.replaceChildren();
  if (edits.ball) entry(said, `The ball is the thing at (${edits.ball.centre_px.map((x) => x.toFixed(0)).join(", ")}) of frame ${edits.ball.frame}`, () => { edits.ball = null; });
  if (edits.range) entry(said, `Only ${edits.range.map((t) => t.toFixed(3)).join(" s to ")} s`, () => { edits.range = null; });
  if (edits.region) entry(said, `Only the region ${edits.region.map((x) => x.toFixed(0)).join(", ")} (left, top, right, bottom; px)`, () => { edits.region = null; });
  for (const frame of [...edits.excluded].sort((a, b) => a - b)) entry(said, `Frame ${frame} is not used`, () => edits.excluded.delete(frame));
  for (const p of edits.points.values()) entry(said, `Frame ${p.frame}: centre at (${p.u_px.toFixed(2)}, ${p.v_px.toFixed(2)})`, () => edits.points.delete(p.frame));
  for (const t of edits.denied) entry(said, `No impact at ${t.toFixed(4)} s`, () => { edits.denied = edits.denied.filter((x) => x !== t); });
  if (!said.childElementCount) entry(said, "nothing yet");
  const list = el("impacts");
  list.replaceChildren();
  impacts.forEach((t, i) => {
    const li = document.createElement("li");
    const label = document.createElement("label");
    const box = document.createElement("input");
    box.type = "checkbox";
    box.checked = !edits.denied.includes(t);
    box.addEventListener("change", () => {
      edits.denied = edits.denied.filter((x) => x !== t);
      if (!box.checked) edits.denied.push(t);
      draw();
    });
    label.append(box, ` impact ${i + 1} at ${t.toFixed(4)} s`);
    li.append(label);
    list.append(li);
  });
  if (!impacts.length) entry(list, "none was measured");
  el("result").textContent = JSON.stringify(file(), null, 1) + "\n";
  const point = points[now][0];
  const why = point && !point.used ? `: ${point.reason}` : "";
  const shownStill = still(now);
  const other = shownStill && shownStill.frame !== now ? ` (around the ball; the rest as in frame ${shownStill.frame})` : "";
  el("where").textContent = `frame ${now} of ${frames - 1}, ${times[now].toFixed(4)} s${why}${other}`;
  el("slider").value = now;
  el("exclude").setAttribute("aria-pressed", edits.excluded.has(now));
}
const HINTS = {
  look: "Drag to move the picture, turn the wheel (or + and −) to zoom, 0 for all of it; ← and → go a frame, with Shift ten; space plays.",
  ball: "Click on the ball: whatever else flies, this one is measured.",
  move: "Click on the ball's centre in this frame; zoom in first. It stands for what was found there, with an uncertainty of 0.5 px.",
  region: "Drag a rectangle: what moves outside of it is not looked at.",
};
function choose(next) {
  mode = next;
  stage.className = mode;
  for (const button of document.querySelectorAll("[data-mode]")) button.setAttribute("aria-pressed", button.dataset.mode === mode);
  el("hint").textContent = HINTS[mode];
}
function draw() {
  drawStage();
  drawStrip();
  drawPlots();
  drawWords();
}
function go(frame) {
  now = Math.min(frames - 1, Math.max(0, Math.round(frame)));
  draw();
}

// ---- hands ----

let dragged = null;
stage.addEventListener("pointerdown", (event) => {
  const at = toFrame(event);
  dragged = { at, x: event.clientX, y: event.clientY, view: { ...view }, region: null, moved: false };
  if (event.pointerId) stage.setPointerCapture(event.pointerId);
});
stage.addEventListener("pointermove", (event) => {
  if (!dragged) return;
  dragged.moved = dragged.moved || Math.hypot(event.clientX - dragged.x, event.clientY - dragged.y) > 3;
  if (mode === "region") {
    const at = toFrame(event), a = dragged.at;
    dragged.region = [Math.min(a[0], at[0]), Math.min(a[1], at[1]), Math.max(a[0], at[0]), Math.max(a[1], at[1])];
  } else if (dragged.moved) {
    const box = stage.getBoundingClientRect();
    view.x = dragged.view.x + ((event.clientX - dragged.x) * stage.width) / box.width;
    view.y = dragged.view.y + ((event.clientY - dragged.y) * stage.height) / box.height;
  }
  draw();
});
stage.addEventListener("pointerup", (event) => {
  if (!dragged) return;
  const [u, v] = toFrame(event);
  const { region, moved } = dragged;
  dragged = null;
  if (mode === "region" && region && region[2] - region[0] > 2 && region[3] - region[1] > 2) {
    edits.region = [Math.max(0, region[0]), Math.max(0, region[1]), Math.min(width - 1, region[2]), Math.min(height - 1, region[3])];
    choose("look");
  } else if (mode === "ball" && !moved) {
    chooseBall(u, v);
  } else if (mode === "move" && !moved) {
    edits.points.set(now, { frame: now, u_px: rounded(u, 2), v_px: rounded(v, 2) });
    edits.excluded.delete(now);
  }
  draw();
});
function chooseBall(u, v) {
  const near = things[now].slice().sort((a, b) => Math.hypot(a.u - u, a.v - v) - Math.hypot(b.u - u, b.v - v))[0];
  const hit = near && Math.hypot(near.u - u, near.v - v) < 1.5 * near.r;
  edits.ball = hit
    ? { frame: now, centre_px: [rounded(near.u, 1), rounded(near.v, 1)], radius_px: rounded(near.r, 1) }
    : { frame: now, centre_px: [rounded(u, 1), rounded(v, 1)] };
  el("hint").textContent = hit ? "Chosen." : "Nothing round was seen to move there: choose it in a frame in which a blue ring surrounds it, or add its radius_px to the file.";
}
stage.addEventListener("wheel", (event) => {
  event.preventDefault();
  zoom(event.deltaY < 0 ? 1.25 : 0.8, toFrame(event));
}, { passive: false });
function play() {
  if (playing) { clearInterval(playing); playing = null; } else playing = setInterval(() => go(now + 1 < frames ? now + 1 : 0), 60);
  el("play").textContent = playing ? "❚❚" : "▶";
}
function exclude() {
  if (!edits.excluded.delete(now)) edits.excluded.add(now);
  draw();
}
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || /^(INPUT|TEXTAREA|SELECT)$/.test(event.target.tagName) && event.target.id !== "slider") return;
  const step = event.shiftKey ? 10 : 1;
  const here = middle(now) || [0.5 * width, 0.5 * height];
  const acts = {
    ArrowLeft: () => go(now - step), ArrowRight: () => go(now + step), Home: () => go(0), End: () => go(frames - 1),
    " ": play, x: exclude, X: exclude, b: () => choose("ball"), m: () => choose("move"), r: () => choose("region"), Escape: () => choose("look"),
    "+": () => zoom(1.25, here), "-": () => zoom(0.8, here), 0: () => { fit(); draw(); },
  };
  const act = acts[event.key];
  if (act) { event.preventDefault(); act(); }
});
for (const button of document.querySelectorAll("[data-mode]")) button.addEventListener("click", () => choose(button.dataset.mode));
el("exclude").addEventListener("click", exclude);
el("play").addEventListener("click", play);
el("back").addEventListener("click", () => go(now - 1));
el("forth").addEventListener("click", () => go(now + 1));
el("nearer").addEventListener("click", () => zoom(1.5, middle(now) || [0.5 * width, 0.5 * height]));
el("farther").addEventListener("click", () => zoom(1 / 1.5, middle(now) || [0.5 * width, 0.5 * height]));
el("slider").addEventListener("input", () => go(Number(el("slider").value)));
el("clear").addEventListener("click", () => {
  Object.assign(edits, { range: null, region: null, ball: null, denied: [] });
  edits.excluded.clear();
  edits.points.clear();
  draw();
});
const text = () => el("result").textContent;
el("save").addEventListener("click", () => {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text()], { type: "application/json" }));
  link.download = data.edits_name;
  link.click();
  el("done").textContent = "Saved where your browser keeps downloads; move it beside the recording.";
});
el("copy").addEventListener("click", async () => {
  try {
    await navigator.clipboard.writeText(text());
    el("done").textContent = "Copied.";
  } catch {
    getSelection().selectAllChildren(el("result"));
    el("done").textContent = "Selected: copy it with Ctrl+C.";
  }
});
window.addEventListener("resize", () => { fit(); draw(); });

// ---- begin ----

const status = el("status");
if (!result) status.textContent = "Not measured yet. Blue rings: round things that move.";
else if (result.status === "measured") status.textContent = `Measured: ${impacts.length} impact${impacts.length === 1 ? "" : "s"}. Green: used; orange: not used; blue rings: round things that move.`;
else status.textContent = `Rejected: ${result.reason}`;
for (const w of (result && result.warnings) || []) {
  const li = document.createElement("li");
  li.className = "warning";
  const code = document.createElement("code");
  code.textContent = w.code;
  li.append(code, " " + w.message);
  el("warnings").append(li);
}
el("slider").max = frames - 1;
el("command").textContent = data.command;
choose("look");
fit();
draw();
})();
