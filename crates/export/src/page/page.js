"use strict";
// The page of a result. `data` is written by crates/export/src/page: maps and histograms quantised to 16 bits, the report.
const data = JSON.parse(document.getElementById("data").textContent);
const element = id => document.getElementById(id);
const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer;

// 16-bit values over a range; 65535 is NaN.
function numbers({ low, high, values }) {
  const words = new Uint16Array(bytes(values));
  return Float32Array.from(words, w => w === 65535 ? NaN : low + (high - low) * w / 65534);
}

const { report } = data, { nx, ny, extent } = data.maps;
const albedo = numbers(data.maps.albedo), depth = numbers(data.maps.depth);
const depth_error = data.maps.depth_error && numbers(data.maps.depth_error);
const probability = data.maps.probability && numbers(data.maps.probability);
const normal = Float32Array.from(new Int8Array(bytes(data.maps.normal)), v => v / 127);
const mask = new Uint8Array(bytes(data.maps.mask));
const counts = numbers(data.light.counts);
const { bins, bin_width, t_start, laser, sensor, laser_scans, pulse } = data.light;
const pairs = laser.length / 3;
const size = [extent[1] - extent[0], extent[3] - extent[2]], pixel = [size[0] / nx, size[1] / ny];
const place = i => [extent[0] + (Math.floor(i / ny) + .5) * pixel[0], extent[2] + (i % ny + .5) * pixel[1], depth[i]];
const isSurface = i => mask[i] === 1 && Number.isFinite(depth[i]);

// Statistics.
function quantile(values, share, keep = () => true) {
  const sorted = Array.from(values).filter((v, i) => Number.isFinite(v) && keep(i)).sort((a, b) => a - b);
  return sorted[Math.round(share * (sorted.length - 1))];
}
const range = (values, keep) => [quantile(values, .01, keep) ?? 0, quantile(values, .99, keep) ?? 1];
const share = ([low, high], v) => high > low ? (v - low) / (high - low) : .5;
const bright = range(albedo), far = range(depth, isSurface);
const sure = depth_error && range(depth_error, isSurface).map(v => Math.max(v, 1e-6));

// Colours.
const VIRIDIS = [[68, 1, 84], [71, 44, 122], [59, 81, 139], [44, 113, 142], [33, 144, 141], [39, 173, 129], [92, 200, 99], [170, 220, 50], [253, 231, 37]];
function viridis(share) {
  const at = Math.min(Math.max(share, 0), 1) * (VIRIDIS.length - 1), i = Math.min(Math.floor(at), VIRIDIS.length - 2);
  return VIRIDIS[i].map((v, c) => v + (VIRIDIS[i + 1][c] - v) * (at - i));
}
const grey = share => { const v = 255 * Math.min(Math.max(share, 0), 1); return [v, v, v]; };
const direction = (x, y, z) => [-x, y, -z].map(v => 127.5 * (1 + v));
const theme = name => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const rgb = colour => `rgb(${colour.map(Math.round)})`;

// Plots: drawn in CSS pixels, redrawn with their width, the theme and the selection.
const plots = [];
function plot(canvas, aspect, draw) {
  const paint = () => {
    const width = canvas.clientWidth, height = Math.round(aspect(width)), ratio = window.devicePixelRatio || 1;
    if (!width) return;
    canvas.style.height = `${height}px`;
    canvas.width = width * ratio, canvas.height = height * ratio;
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    context.font = "12px system-ui, sans-serif";
    draw(context, width, height);
  };
  plots.push(paint), new ResizeObserver(paint).observe(canvas);
  return paint;
}
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { pictures(), plots.forEach(paint => paint()); });

function ticks(low, high, most) {
  const raw = (high - low) / most, power = 10 ** Math.floor(Math.log10(raw)), step = [1, 2, 5, 10].find(s => s * power >= raw) * power;
  if (!(high > low) || !Number.isFinite(step)) return [low];
  const first = Math.ceil(low / step - 1e-9), count = Math.floor(high / step + 1e-9) - first + 1;
  return Array.from({ length: count }, (_, k) => Number(((first + k) * step).toPrecision(6)));
}
const short = v => (v !== 0 && (Math.abs(v) >= 1e5 || Math.abs(v) < 1e-3) ? v.toExponential(0) : String(Number(v.toPrecision(3)))).replace("-", "−");

// Axes around `box` = [left, top, right, bottom]; `x` and `y` map values to pixels.
function axes(context, [left, top, right, bottom], xs, x, xName, ys, y, yName) {
  context.strokeStyle = theme("edge"), context.lineWidth = 1;
  context.strokeRect(left - .5, top - .5, right - left + 1, bottom - top + 1);
  context.fillStyle = theme("soft"), context.strokeStyle = theme("soft");
  context.textAlign = "center", context.textBaseline = "top";
  xs.forEach(v => { context.fillRect(x(v) - .5, bottom, 1, 4), context.fillText(short(v), x(v), bottom + 6); });
  context.fillText(xName, (left + right) / 2, bottom + 20);
  context.textAlign = "right", context.textBaseline = "middle";
  ys.forEach(v => { context.fillRect(left - 4, y(v) - .5, 4, 1), context.fillText(short(v), left - 6, y(v)); });
  context.save(), context.translate(9, (top + bottom) / 2), context.rotate(-Math.PI / 2);
  context.textAlign = "center", context.fillText(yName, 0, 0), context.restore();
}

// Colour bar right of `box`; `at` maps a share from the bottom to the value there.
function colourBar(context, [, top, right, bottom], colour, values, at, unit) {
  const x = right + 10, height = bottom - top;
  for (let k = 0; k < height; k++) context.fillStyle = rgb(colour(1 - k / height)), context.fillRect(x, top + k, 12, 1.5);
  context.fillStyle = theme("soft"), context.textAlign = "left", context.textBaseline = "middle";
  values.forEach(v => {
    const y = bottom - height * at(v);
    context.fillRect(x + 12, y - .5, 3, 1), context.fillText(short(v), x + 17, y);
  });
  context.textAlign = "right", context.textBaseline = "top";
  context.fillText(unit, right + 60, bottom + 20);
}

function scaleBar(context, [left, , right, bottom], metres) {
  const power = 10 ** Math.floor(Math.log10(metres / 3)), length = Number(([5, 2, 1].find(s => s * power <= metres / 3) * power).toPrecision(1)), width = length / metres * (right - left), y = bottom - 10;
  for (const [colour, thickness] of [["#000", 5], ["#fff", 3]]) context.fillStyle = colour, context.fillRect(left + 10 - (thickness - 3) / 2, y - thickness / 2, width + thickness - 3, thickness);
  context.textAlign = "left", context.textBaseline = "bottom", context.lineWidth = 3, context.strokeStyle = "#000", context.fillStyle = "#fff";
  context.strokeText(`${length} m`, left + 10, y - 4), context.fillText(`${length} m`, left + 10, y - 4);
}

function ring(context, x, y) {
  for (const [colour, width] of [["#fff", 4], [theme("mark"), 2]]) {
    context.strokeStyle = colour, context.lineWidth = width;
    context.beginPath(), context.arc(x, y, 6, 0, 2 * Math.PI), context.stroke();
  }
}

// The maps as seen from the wall: +x to the left, y up.
const metres = v => `${v.toFixed(3)} m`, millimetres = v => v < 1 ? `${Number((1000 * v).toPrecision(2))} mm` : `${v.toFixed(1)} m`;
const nothing = () => theme("none").match(/[0-9a-f]{2}/g).map(v => parseInt(v, 16));
const maps = [
  { name: "Albedo", alt: `Albedo map, relative, up to ${short(bright[1])}`, colour: i => grey(albedo[i] / bright[1]),
    bar: (c, box) => colourBar(c, box, grey, ticks(0, bright[1], 4), v => v / bright[1], "relative") },
  { name: "Depth", alt: `Depth map, ${metres(far[0])} to ${metres(far[1])}; bright is near`, colour: i => isSurface(i) ? viridis(1 - share(far, depth[i])) : null,
    bar: (c, box) => colourBar(c, box, s => viridis(1 - s), ticks(...far, 6), v => share(far, v), "m") },
  { name: "Normals", alt: "Map of surface normals, coloured by direction", colour: i => isSurface(i) ? direction(normal[3 * i], normal[3 * i + 1], normal[3 * i + 2]) : null, bar: compass },
];
if (depth_error) {
  const logs = sure.map(Math.log), marks = [1e-5, 2e-5, 5e-5].flatMap(v => [1, 10, 100, 1000, 1e4].map(p => v * p)).filter(v => v >= sure[0] && v <= sure[1]);
  maps.push({ name: "Expected depth error", alt: `Map of the expected depth error, ${millimetres(sure[0])} to ${millimetres(sure[1])}`, colour: i => isSurface(i) ? viridis(share(logs, Math.log(depth_error[i]))) : null,
    bar: (c, box) => colourBar(c, box, viridis, marks.map(v => 1000 * v), v => share(logs, Math.log(v / 1000)), "mm") });
}

if (probability) maps.push({ name: "Probability of surface", alt: "Map of the probability of surface, 0 to 1", colour: i => viridis(probability[i]),
  bar: (c, box) => colourBar(c, box, viridis, [0, .25, .5, .75, 1], v => v, "") });

// Legend of the normals: their colours on the hemisphere that faces the wall.
function compass(context, [, top, right]) {
  const radius = 22, x0 = right + 34, y0 = top + radius + 14;
  for (let x = -radius; x < radius; x++) for (let y = -radius; y < radius; y++) {
    const [u, v] = [(x + .5) / radius, (y + .5) / radius], rest = 1 - u * u - v * v;
    if (rest > 0) context.fillStyle = rgb(direction(-u, -v, -Math.sqrt(rest))), context.fillRect(x0 + x, y0 + y, 1.2, 1.2);
  }
  context.fillStyle = theme("soft"), context.textAlign = "center", context.textBaseline = "bottom";
  context.fillText("up", x0, y0 - radius - 1), context.textBaseline = "top", context.fillText("facing", x0, y0 + radius + 3), context.fillText("direction", x0, y0 + radius + 17);
}

let chosen = -1, held = false, pair = 0;
const LEFT = 46, RIGHT = 62, TOP = 6, BOTTOM = 38;
const mapBox = width => [LEFT, TOP, width - RIGHT, TOP + (width - LEFT - RIGHT) * size[1] / size[0]];
for (const map of maps) {
  const figure = document.createElement("figure"), heading = document.createElement("h3"), canvas = document.createElement("canvas");
  heading.innerText = map.name;
  canvas.tabIndex = 0, canvas.setAttribute("role", "img"), canvas.setAttribute("aria-label", `${map.alt}. ${nx} by ${ny} pixels. Arrow keys select a pixel.`);
  const button = document.createElement("button");
  button.innerText = "Save without axes (PNG)", button.onclick = () => save(`${map.name.toLowerCase()}.png`, plain(map));
  figure.append(heading, canvas, button), element("maps").append(figure);
  plot(canvas, width => mapBox(width)[3] + BOTTOM, (context, width) => {
    const box = mapBox(width), [left, top, right, bottom] = box;
    const x = v => left + (extent[1] - v) / size[0] * (right - left), y = v => top + (extent[3] - v) / size[1] * (bottom - top);
    context.imageSmoothingEnabled = false, context.drawImage(map.picture, left, top, right - left, bottom - top);
    axes(context, box, ticks(extent[0], extent[1], 5), x, "x, m", ticks(extent[2], extent[3], 5), y, "y, m");
    map.bar(context, box), scaleBar(context, box, size[0]);
    if (chosen >= 0) ring(context, x(place(chosen)[0]), y(place(chosen)[1]));
  });
  const at = event => {
    const around = canvas.getBoundingClientRect(), [left, top, right, bottom] = mapBox(canvas.clientWidth);
    const u = (event.clientX - around.left - left) / (right - left), v = (event.clientY - around.top - top) / (bottom - top);
    return u >= 0 && u < 1 && v >= 0 && v < 1 ? (nx - 1 - Math.floor(u * nx)) * ny + ny - 1 - Math.floor(v * ny) : -1;
  };
  canvas.onmousemove = event => { const i = at(event); if (!held && i >= 0) choose(i); };
  canvas.onclick = event => { const i = at(event); if (i >= 0) held = !held || i !== chosen, choose(i); };
  canvas.onkeydown = event => {
    const step = arrow(event);
    if (!step) return;
    const n = event.shiftKey ? 8 : 1, clamp = (v, end) => Math.min(Math.max(v, 0), end - 1), from = Math.max(chosen, 0);
    held = true, choose(clamp(Math.floor(from / ny) - n * step[0], nx) * ny + clamp(from % ny + n * step[1], ny));
  };
}
// The step of an arrow key, right and up, or nothing.
function arrow(event) {
  const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
  if (step) event.preventDefault();
  return step;
}
// A map without axes, pixel by pixel; `empty` where there is no surface.
function drawn({ colour }, empty) {
  const canvas = document.createElement("canvas"), image = new ImageData(nx, ny);
  canvas.width = nx, canvas.height = ny;
  for (let i = 0; i < nx * ny; i++) image.data.set([...(colour(i) || empty), 255], 4 * ((ny - 1 - i % ny) * nx + nx - 1 - Math.floor(i / ny)));
  canvas.getContext("2d").putImageData(image, 0, 0);
  return canvas;
}
function pictures() {
  const empty = nothing();
  for (const map of maps) map.picture = drawn(map, empty);
}

// Files for papers: white where there is no surface.
function plain(map) {
  const canvas = document.createElement("canvas"), context = canvas.getContext("2d"), factor = Math.ceil(512 / Math.max(nx, ny));
  canvas.width = factor * nx, canvas.height = factor * ny, context.imageSmoothingEnabled = false;
  context.drawImage(drawn(map, [255, 255, 255]), 0, 0, canvas.width, canvas.height);
  return canvas.toDataURL();
}
function save(name, address) {
  const link = document.createElement("a");
  link.download = `${data.title.replace(/\.[^.]*$/, "")} ${name}`, link.href = address, link.click();
}
element("figure").onclick = () => save("maps.svg", URL.createObjectURL(new Blob([data.figure], { type: "image/svg+xml" })));

function choose(i) {
  chosen = i, plots.forEach(paint => paint()), mark();
  const [x, y] = place(i), angle = Math.acos(Math.min(1, -normal[3 * i + 2])) * 180 / Math.PI;
  element("readout").innerText = `x ${metres(x)}, y ${metres(y)}, pixel ${Math.floor(i / ny)}, ${i % ny}: albedo ${short(albedo[i])}`
    + (probability ? `, probability of surface ${probability[i].toFixed(2)}` : "")
    + (isSurface(i) ? `, depth ${depth[i].toFixed(4)} m` + (depth_error ? ` ± ${millimetres(depth_error[i])}` : "")
      + `\nnormal ${[0, 1, 2].map(c => normal[3 * i + c].toFixed(2)).join(", ")}, ${angle.toFixed(0)}° from the wall's` : ", no surface");
}

// Light.
const arm = (points, p, at) => Math.hypot(points[3 * p] - at[0], points[3 * p + 1] - at[1], points[3 * p + 2] - at[2]);
const path = (p, at) => arm(laser, p, at) + arm(sensor, p, at);
const moving = laser_scans ? laser : sensor;

// Histogram of a pair rendered from the maps by the resolved reflectance model, without a scale.
const kept = new Map();
function rendered(p) {
  if (kept.has(p)) return kept.get(p);
  const light = new Float32Array(bins), model = report.settings.model, scanned = laser_scans ? laser : sensor;
  const cosine = (points, i, at, d) => [0, 1, 2].reduce((s, c) => s + normal[3 * i + c] * (points[3 * p + c] - at[c]) / d, 0);
  for (let i = 0; i < nx * ny; i++) {
    if (!isSurface(i)) continue;
    const at = place(i), there = arm(laser, p, at), back = arm(sensor, p, at);
    let value = albedo[i] / (there * back);
    if (model !== "retroreflective") value /= there * back;
    if (model === "cosine") value *= Math.max(0, cosine(scanned, i, at, laser_scans ? there : back));
    if (model === "lambertian") {
      value *= Math.max(0, cosine(laser, i, at, there)) * Math.max(0, cosine(sensor, i, at, back));
      value *= Math.abs(at[2] - laser[3 * p + 2]) / there * Math.abs(at[2] - sensor[3 * p + 2]) / back;
    }
    const bin = (there + back - t_start) / bin_width - .5, low = Math.floor(bin);
    if (low >= 0 && low < bins) light[low] += value * (low + 1 - bin);
    if (low + 1 >= 0 && low + 1 < bins) light[low + 1] += value * (bin - low);
  }
  kept.set(p, pulse > bin_width ? blurred(light, pulse / bin_width / 2.355) : light);
  return kept.get(p);
}
function blurred(light, sigma) {
  const reach = Math.ceil(3 * sigma), taps = [];
  for (let k = -reach; k <= reach; k++) taps.push(Math.exp(-.5 * (k / sigma) ** 2));
  const sum = taps.reduce((a, b) => a + b, 0);
  return light.map((_, bin) => taps.reduce((s, w, k) => s + w / sum * (light[bin + k - reach] || 0), 0));
}
const measured = p => counts.subarray(p * bins, (p + 1) * bins);

// One scale for all pairs, fitted to up to 49 of them.
const fit = (() => {
  let own = 0, both = 0;
  for (let k = 0; k < Math.min(pairs, 49); k++) {
    const p = Math.floor((k + .5) * pairs / Math.min(pairs, 49)), light = rendered(p), found = measured(p);
    for (let bin = 0; bin < bins; bin++) own += light[bin] ** 2, both += light[bin] * found[bin];
  }
  return own > 0 ? Math.max(both / own, 0) : 0;
})();

const LIGHT_SPEED = .299792458, common = element("common"), slider = element("slider");
const paintHistogram = plot(element("histogram"), width => Math.max(270, .52 * width), (context, width, height) => {
  const found = measured(pair), light = rendered(pair).map(v => fit * v);
  const most = Math.max(...common.checked ? [data.light.counts.high] : [...found, ...light], 1e-30);
  const box = [58, 36, width - 8, height - BOTTOM], [left, top, right, bottom] = box, end = t_start + bins * bin_width;
  const x = t => left + (t - t_start) / (end - t_start) * (right - left), y = v => bottom - (bottom - top - 6) * v / most;
  context.save(), context.beginPath(), context.rect(left, top, right - left, bottom - top), context.clip();
  context.fillStyle = theme("bar");
  found.forEach((v, bin) => context.fillRect(x(t_start + bin * bin_width), y(v), Math.max(1, (right - left) / bins - .3), bottom - y(v)));
  context.strokeStyle = theme("line"), context.lineWidth = 1.5;
  context.beginPath(), light.forEach((v, bin) => context.lineTo(x(t_start + (bin + .5) * bin_width), y(v))), context.stroke();
  if (chosen >= 0 && isSurface(chosen)) context.fillStyle = theme("mark"), context.fillRect(x(path(pair, place(chosen))) - 1, top, 2, bottom - top);
  context.restore();
  axes(context, box, ticks(t_start, end, width / 70), x, "path length, m", ticks(0, most, 5), y, "counts per bin");
  // The same axis as time of flight, above.
  context.textAlign = "center", context.textBaseline = "bottom";
  ticks(t_start / LIGHT_SPEED, end / LIGHT_SPEED, width / 70).forEach(ns => { const at = x(ns * LIGHT_SPEED); context.fillRect(at - .5, top - 4, 1, 4), context.fillText(short(ns), at, top - 5); });
  context.fillText("time of flight, ns", (left + right) / 2, top - 19);
  const points = [laser, sensor].map(p => [0, 1, 2].map(c => p[3 * pair + c].toFixed(3)).join(", "));
  element("light").innerText = `Pair ${pair + 1} of ${pairs} shown; laser point (${points[0]}) m, sensor point (${points[1]}) m; bins of ${millimetres(bin_width)}, ${short(1000 * bin_width / LIGHT_SPEED)} ps.`;
  element("histogram").setAttribute("aria-label", `Histogram of pair ${pair + 1} over path lengths of ${metres(t_start)} to ${metres(end)}, at most ${Math.max(...found).toPrecision(3)} counts in a bin`);
  slider.value = pair + 1, slider.setAttribute("aria-valuetext", `pair ${pair + 1} of ${pairs}, wall point x ${metres(moving[3 * pair])}, y ${metres(moving[3 * pair + 1])}`);
});
slider.max = pairs, slider.disabled = pairs < 2;
slider.oninput = () => select(slider.value - 1), common.onchange = paintHistogram;

// The wall.
const wall = element("wall");
const span = [0, 1].map(c => { const all = Array.from({ length: pairs }, (_, p) => moving[3 * p + c]); return [all.reduce((a, b) => Math.min(a, b)), all.reduce((a, b) => Math.max(a, b))]; });
const reach = Math.max(span[0][1] - span[0][0], span[1][1] - span[1][0]) || 1, dot = reach / Math.max(1, Math.sqrt(pairs) - 1) || reach;
// Width and height of a tile: the spacing of a lattice, of which rows or columns may be left out, or that of a square scan.
const lines = span.map((_, c) => new Set(Array.from({ length: pairs }, (_, p) => Math.round(1e4 * moving[3 * p + c] / reach))).size);
const tile = lines[0] * lines[1] <= 1.2 * pairs ? span.map(([low, high], c) => (high - low) / (lines[c] - 1) || dot) : [dot, dot];
const totals = Array.from({ length: pairs }, (_, p) => measured(p).reduce((a, b) => a + b, 0)), most = totals.reduce((a, b) => Math.max(a, b), 1e-30);
const apart = (p, at) => Math.hypot(moving[3 * p] - at[0], moving[3 * p + 1] - at[1]);
const nearest = (at, keep = () => true) => { let best = -1; for (let p = 0; p < pairs; p++) if (keep(p) && (best < 0 || apart(p, at) < apart(best, at))) best = p; return best; };
const edges = span.map(([low, high]) => { const mid = (low + high) / 2, half = (reach + dot) / 2; return [mid - half, mid + half]; });
const wallBox = width => [LEFT, TOP, width - RIGHT, TOP + width - LEFT - RIGHT];
pair = nearest(span.map(([low, high]) => (low + high) / 2));
wall.setAttribute("aria-label", `Total counts of ${pairs} wall points, at most ${short(most)}. Arrow keys select a pair.`);
const paintWall = plot(wall, width => wallBox(width)[3] + BOTTOM, (context, width) => {
  const box = wallBox(width), [left, top, right, bottom] = box, unit = (right - left) / (edges[0][1] - edges[0][0]);
  const x = v => left + (edges[0][1] - v) * unit, y = v => top + (edges[1][1] - v) * unit, [wide, high] = tile.map(v => Math.max(2, v * unit));
  context.fillStyle = theme("none"), context.fillRect(left, top, right - left, bottom - top);
  context.save(), context.beginPath(), context.rect(left, top, right - left, bottom - top), context.clip();
  totals.forEach((total, p) => {
    context.fillStyle = rgb(grey(Math.max(total, 0) / most)), context.fillRect(x(moving[3 * p]) - wide / 2, y(moving[3 * p + 1]) - high / 2, wide + 1, high + 1);
  });
  context.restore();
  axes(context, box, ticks(...edges[0], 5), x, "x, m", ticks(...edges[1], 5), y, "y, m");
  colourBar(context, box, grey, ticks(0, most, 4), v => v / most, "counts"), scaleBar(context, box, edges[0][1] - edges[0][0]);
  ring(context, x(moving[3 * pair]), y(moving[3 * pair + 1]));
});
function select(p) {
  if (p >= 0 && p !== pair) pair = p, paintWall(), paintHistogram(), mark();
}
const under = event => {
  const around = wall.getBoundingClientRect(), [left, top, right] = wallBox(wall.clientWidth), unit = (edges[0][1] - edges[0][0]) / (right - left);
  return nearest([edges[0][1] - (event.clientX - around.left - left) * unit, edges[1][1] - (event.clientY - around.top - top) * unit]);
};
wall.style.touchAction = "none";
wall.onpointerdown = event => { wall.setPointerCapture(event.pointerId), select(under(event)); };
wall.onpointermove = event => { if (wall.hasPointerCapture(event.pointerId)) select(under(event)); };
wall.onkeydown = event => {
  const step = arrow(event), from = [moving[3 * pair], moving[3 * pair + 1]];
  if (step) select(nearest(from, p => {
    const d = [moving[3 * p] - from[0], moving[3 * p + 1] - from[1]], along = -step[0] * d[0] + step[1] * d[1];
    return along > 1e-9 && along > .7 * Math.hypot(...d);
  }));
};

// The surface in 3D, rotated by 180° about y: the viewer is at the wall, depth increases away from it.
let mark = () => {};

// A WebGL program for vertices of place, colour and normal; a normal of zero is not lit.
function painter(gl) {
  const program = gl.createProgram();
  for (const [kind, source] of [
    [gl.VERTEX_SHADER, `attribute vec3 place, colour, normal; uniform mat4 camera; uniform float dot_size; varying vec3 paint, up;
      void main() { gl_Position = camera * vec4(place, 1.); gl_PointSize = max(dot_size / gl_Position.w, 1.); paint = colour; up = normal; }`],
    [gl.FRAGMENT_SHADER, `precision mediump float; varying vec3 paint, up;
      void main() {
        float sun = dot(normalize(up + 1e-9), normalize(vec3(-.6, .8, 1.5))) * (gl_FrontFacing ? 1. : -1.);
        gl_FragColor = vec4(pow(paint * (length(up) > 0. ? .16 + .7 * max(sun, 0.) : 1.), vec3(.4545)), 1.);
      }`],
  ]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source), gl.compileShader(shader), gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program) || "the WebGL program does not link");
  gl.useProgram(program), gl.enable(gl.DEPTH_TEST);
  const uniform = name => gl.getUniformLocation(program, name);
  // Vertices of nine numbers each, and what draws them.
  const shape = vertices => {
    const buffer = gl.createBuffer(), fill = all => (gl.bindBuffer(gl.ARRAY_BUFFER, buffer), gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(all), gl.STATIC_DRAW));
    const bind = lit => {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      ["place", "colour", "normal"].forEach((name, k) => {
        const at = gl.getAttribLocation(program, name);
        if (k === 2 && !lit) return gl.disableVertexAttribArray(at), gl.vertexAttrib3f(at, 0, 0, 0);
        gl.enableVertexAttribArray(at), gl.vertexAttribPointer(at, 3, gl.FLOAT, false, 36, 12 * k);
      });
    };
    fill(vertices);
    return { fill, bind };
  };
  return { shape, camera: uniform("camera"), dots: uniform("dot_size") };
}

// Vertices of the surface, and corners of its triangles: no triangle bridges a step in depth.
function surface() {
  const number = new Int32Array(nx * ny).fill(-1), vertices = [], corners = [];
  for (let i = 0; i < nx * ny; i++) {
    if (!isSurface(i)) continue;
    number[i] = vertices.length / 9;
    const [x, y, z] = place(i), v = .25 + .75 * Math.sqrt(Math.min(Math.max(albedo[i] / bright[1], 0), 1));
    vertices.push(-x, y, -z, v, v, v, 0, 0, 0);
  }
  const step = 4 * Math.max(...pixel), near = (...all) => all.every(i => number[i] >= 0) && Math.max(...all.map(i => depth[i])) - Math.min(...all.map(i => depth[i])) < step;
  for (let x = 0; x + 1 < nx; x++) for (let y = 0; y + 1 < ny; y++) {
    const [a, b, c, d] = [x * ny + y, (x + 1) * ny + y, (x + 1) * ny + y + 1, x * ny + y + 1];
    if (near(a, b, c)) corners.push(number[a], number[c], number[b]);
    if (near(a, c, d)) corners.push(number[a], number[d], number[c]);
  }
  for (let k = 0; k < corners.length; k += 3) {
    const [p, q, r] = [0, 1, 2].map(j => corners[k + j] * 9), [u, v] = [q, r].map(end => [0, 1, 2].map(c => vertices[end + c] - vertices[p + c]));
    [0, 1, 2].forEach(c => { const [d, e] = [(c + 1) % 3, (c + 2) % 3], across = u[d] * v[e] - u[e] * v[d]; for (const at of [p, q, r]) vertices[at + 6 + c] += across; });
  }
  return { vertices, corners: new Uint16Array(corners) };
}

function space() {
  const holder = element("space"), canvas = document.createElement("canvas"), gl = canvas.getContext("webgl");
  holder.setAttribute("aria-label", `The surface in 3D, depths of ${metres(far[0])} to ${metres(far[1])}. Arrow keys rotate, plus and minus zoom.`);
  if (!gl) throw new Error("the browser has no WebGL");
  holder.append(canvas);
  const { shape, camera, dots } = painter(gl), { vertices, corners } = surface(), [x0, x1, y0, y1] = extent;
  const solid = shape(vertices), grey = [.25, .25, .32, 0, 0, 0], red = [1, .08, .045, 0, 0, 0];
  const frame = shape([[x0, y0], [x1, y0], [x1, y0], [x1, y1], [x1, y1], [x0, y1], [x0, y1], [x0, y0]].flatMap(([x, y]) => [-x, y, 0, ...grey])), rays = shape([]);
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer()), gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, corners, gl.STATIC_DRAW);
  // The eye looks at the middle of the surface, from an arm of this length; its angles are those about y and from it.
  const middle = [-(x0 + x1) / 2, (y0 + y1) / 2, -(far[0] + far[1]) / 2], wide = Math.max(x1 - x0, y1 - y0), from = [-.6 * wide, .3 * wide, 1.7 * wide - middle[2]];
  let arm = Math.hypot(...from), about = Math.atan2(from[0], from[2]), down = Math.acos(from[1] / arm), solidly = true, marked = false;
  const draw = () => {
    const [width, height] = [canvas.width, canvas.height], focal = 1 / Math.tan(20 * Math.PI / 180), [near, end] = [.001 * wide, 100 * wide];
    const [s, c, t, u] = [Math.sin(about), Math.cos(about), Math.sin(down), Math.cos(down)], back = [t * s, u, t * c];
    const rows = [[c, 0, -s].map(v => v * focal * height / width), [-u * s, t, -u * c].map(v => v * focal), back.map(v => v * (end + near) / (near - end)), back.map(v => -v)];
    const eye = middle.map((v, k) => v + arm * back[k]), shift = [0, 0, 2 * end * near / (near - end), 0];
    const columns = [0, 1, 2].flatMap(k => rows.map(row => row[k])), last = rows.map((row, k) => shift[k] - row.reduce((sum, v, j) => sum + v * eye[j], 0));
    gl.viewport(0, 0, width, height);
    // The page shows through, light or dark.
    gl.clearColor(0, 0, 0, 0), gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniformMatrix4fv(camera, false, [...columns, ...last]), gl.uniform1f(dots, .4 * Math.min(...pixel) * focal * height);
    solid.bind(solidly);
    if (solidly) gl.drawElements(gl.TRIANGLES, corners.length, gl.UNSIGNED_SHORT, 0);
    else gl.drawArrays(gl.POINTS, 0, vertices.length / 9);
    frame.bind(false), gl.drawArrays(gl.LINES, 0, 8);
    if (marked) rays.bind(false), gl.drawArrays(gl.LINES, 0, 4);
  };
  const paint = () => {
    const width = holder.clientWidth, height = Math.round(.66 * width), ratio = window.devicePixelRatio || 1;
    if (!width) return;
    canvas.width = width * ratio, canvas.height = height * ratio, canvas.style.height = `${height}px`;
    mark();
  };
  const turn = (round, up, zoom) => {
    about += round, down = Math.min(Math.max(down + up, .05), 3.09), arm = Math.min(Math.max(arm * zoom, .01 * wide), 50 * wide);
    draw();
  };
  // One pointer rotates, two zoom by their distance.
  const held = new Map(), distance = () => { const [a, b] = held.values(); return Math.hypot(a[0] - b[0], a[1] - b[1]) || 1; };
  canvas.style.touchAction = "none";
  canvas.onpointerdown = event => { canvas.setPointerCapture(event.pointerId), held.set(event.pointerId, [event.clientX, event.clientY]); };
  canvas.onpointerup = canvas.onpointercancel = event => { held.delete(event.pointerId); };
  canvas.onpointermove = event => {
    if (!held.has(event.pointerId)) return;
    const [x, y] = held.get(event.pointerId), before = held.size > 1 && distance(), unit = 2 * Math.PI / canvas.clientHeight;
    held.set(event.pointerId, [event.clientX, event.clientY]);
    if (before) turn(0, 0, before / distance());
    else turn((x - event.clientX) * unit, (y - event.clientY) * unit, 1);
  };
  canvas.addEventListener("wheel", event => { event.preventDefault(), turn(0, 0, Math.exp(.001 * Math.sign(event.deltaY) * Math.min(Math.abs(event.deltaY), 200))); }, { passive: false });
  element("nearer").onclick = () => turn(0, 0, .8), element("farther").onclick = () => turn(0, 0, 1.25);
  holder.onkeydown = event => {
    const step = arrow(event);
    if (step) turn(.15 * step[0], -.15 * step[1], 1);
    if (event.key === "+" || event.key === "-") turn(0, 0, event.key === "+" ? .8 : 1.25);
  };
  element("as").onclick = () => { solidly = !solidly, element("as").innerText = solidly ? "points" : "mesh", draw(); };
  mark = () => {
    marked = chosen >= 0 && isSurface(chosen);
    if (marked) {
      const [x, y, z] = place(chosen);
      rays.fill([laser, sensor].flatMap(points => [-points[3 * pair], points[3 * pair + 1], -points[3 * pair + 2], ...red, -x, y, -z, ...red]));
    }
    draw();
  };
  plots.push(paint), new ResizeObserver(paint).observe(holder);
}

// The trace.
const trace = report.trace.filter(t => t.loss > 0);
plot(element("trace"), width => Math.max(240, .66 * width), (context, width, height) => {
  if (!trace.length) return;
  const begin = trace.length > 1 ? trace[0].seconds : 0, end = Math.max(trace.at(-1).seconds, begin + 1e-6), active = Math.max(...trace.map(t => t.active), 1), losses = trace.map(t => t.loss);
  const [low, high] = [Math.min(...losses), Math.max(...losses)].map(Math.log10), span = [low - .05, Math.max(high, low + .1) + .05];
  const box = [58, 8, width - 8, height - BOTTOM], [left, top, right, bottom] = box;
  const x = s => left + (s - begin) / (end - begin) * (right - left), y = v => bottom - (bottom - top) * share(span, Math.log10(v));
  context.fillStyle = theme("area");
  context.beginPath(), context.moveTo(x(trace[0].seconds), bottom);
  trace.forEach(t => context.lineTo(x(t.seconds), bottom - .8 * (bottom - top) * t.active / active));
  context.lineTo(x(end), bottom), context.fill();
  context.strokeStyle = theme("line"), context.lineWidth = 1.5;
  context.beginPath(), trace.forEach(t => context.lineTo(x(t.seconds), y(t.loss))), context.stroke();
  const changes = trace.filter((t, k) => k > 0 && (t.lateral !== trace[k - 1].lateral || t.pairs !== trace[k - 1].pairs));
  element("resolutions").hidden = !changes.length;
  context.strokeStyle = theme("soft"), context.setLineDash([4, 4]);
  changes.forEach(t => { context.beginPath(), context.moveTo(x(t.seconds), top), context.lineTo(x(t.seconds), bottom), context.stroke(); });
  context.setLineDash([]);
  const marks = Array.from({ length: 40 }, (_, k) => k - 20).flatMap(p => [1, 2, 5].map(m => m * 10 ** p)).filter(v => Math.log10(v) >= span[0] && Math.log10(v) <= span[1]);
  if (marks.length < 3) marks.splice(0, marks.length, ...ticks(10 ** span[0], 10 ** span[1], 4));
  axes(context, box, ticks(begin, end, 6), x, "solve time, s", marks, y, "loss (logarithmic)");
  element("active").innerText = `active ${report.settings.solver === "surface" ? "pixels" : "voxels"}, at most ${active.toLocaleString("en")}`;
  element("trace").setAttribute("aria-label", `Loss against solve time, ${losses[0].toPrecision(3)} to ${losses.at(-1).toPrecision(3)} in ${end.toFixed(1)} s`);
});

// Connected parts of the mask with at least 2 % of its pixels, and the box around them, metres.
function parts() {
  const seen = new Uint8Array(nx * ny), all = mask.reduce((n, m) => n + m, 0), box = [Infinity, -Infinity, Infinity, -Infinity];
  let count = 0;
  for (let start = 0; start < nx * ny; start++) {
    if (seen[start] || !isSurface(start)) continue;
    const part = [start];
    seen[start] = 1;
    for (let k = 0; k < part.length; k++) {
      const [x, y] = [Math.floor(part[k] / ny), part[k] % ny];
      for (const [u, v] of [[x - 1, y], [x + 1, y], [x, y - 1], [x, y + 1]]) {
        const i = u * ny + v;
        if (u >= 0 && u < nx && v >= 0 && v < ny && !seen[i] && isSurface(i)) seen[i] = 1, part.push(i);
      }
    }
    if (part.length < .02 * all) continue;
    count++;
    for (const i of part) { const [x, y] = place(i); box[0] = Math.min(box[0], x), box[1] = Math.max(box[1], x), box[2] = Math.min(box[2], y), box[3] = Math.max(box[3], y); }
  }
  return { count, all, width: box[1] - box[0] + pixel[0], height: box[3] - box[2] + pixel[1] };
}

// Figures against truth, and the map of differences.
function truth(metrics, digits) {
  element("truth").hidden = false;
  element("difference").closest("figure").hidden = !data.difference;
  if (data.difference) element("difference").src = `data:image/png;base64,${data.difference}`;
  const paper = metrics.paper || {}, best = metrics.at_best || {}, of = (a, b) => `${a}, ${b}`;
  for (const [name, value] of [
    ["IoU, completeness", of(digits(metrics.iou), digits(metrics.completeness))],
    ["Depth, mean and RMS error", of(digits(metrics.depth_mae, " mm", 1e3), digits(metrics.depth_rmse, " mm", 1e3))],
    ["Normals, mean error", digits(metrics.normal_error_deg, "°")],
    ["Paper: depth, mean and RMS error", of(digits(paper.depth_mae, " m"), digits(paper.depth_rmse, " m"))],
    ["Paper: normals, mean and RMS error", of(digits(paper.normal_mae), digits(paper.normal_rmse))],
    ["Within the expected depth error", metrics.within_depth_error == null ? "–" : `${digits(metrics.within_depth_error, " %", 100)} of the pixels (68 % if it is right)`],
    ["Best IoU over mask fractions", metrics.best_iou == null ? "–" : `${digits(metrics.best_iou)} at ${digits(metrics.best_fraction)}, depth error ${digits(best.depth_mae, " mm", 1e3)}`],
  ]) {
    const row = element("figures").insertRow(), head = document.createElement("th");
    head.scope = "row", head.innerText = name, row.append(head);
    row.insertCell().innerText = value;
  }
}

function words() {
  const { settings, totals, metrics } = report, found = parts(), warnings = report.warnings || settings.warnings || [];
  const card = (name, value, more = "") => {
    const group = document.createElement("div"), term = document.createElement("dt"), text = document.createElement("dd"), small = document.createElement("small");
    term.innerText = name, text.innerText = value, small.innerText = more;
    text.append(small), group.append(term, text), element("headline").append(group);
  };
  element("title").innerText = data.title;
  const { verdict } = report;
  if (verdict) card("Verdict", verdict.grade, verdict.reasons.join("; "));
  card("Found", found.count ? `${found.count} ${found.count === 1 ? "surface" : "surfaces"}` : "nothing",
    found.count ? `${found.width.toFixed(2)} × ${found.height.toFixed(2)} m, ${(100 * found.all / nx / ny).toFixed(1)} % of the picture` : "");
  card("Depth range", found.count ? `${far[0].toFixed(3)} – ${far[1].toFixed(3)} m` : "–", "1st to 99th percentile");
  const typical = depth_error && quantile(depth_error, .5, isSurface);
  card("Median depth error", typical ? millimetres(typical) : "–", "expected" );
  const digits = (v, unit = "", factor = 1) => v == null ? "–" : `${Number((factor * v).toPrecision(3))}${unit}`;
  if (metrics) {
    card("IoU", digits(metrics.iou), "of surface and true surface");
    card("Depth error", digits(metrics.depth_mae, " mm", 1e3), `mean; ${digits(metrics.paper?.depth_mae, " mm", 1e3)} by the paper's measure`);
    card("Normal error", digits(metrics.normal_error_deg, "°"), "mean over surface in both");
    truth(metrics, digits);
  }
  const kept = (settings.candidates || []).find(c => c.kept), [held, , excess] = kept?.left || [];
  const quality = excess == null ? "" : `noise alone leaves ${digits(Math.max(held - excess, 0), " %", 100)}; `;
  const trials = (settings.model_found?.trials || []).filter(t => t[0] === settings.model_found.reflectance).map(t => t[2]), last = trace.at(-1)?.residual;
  if (trials.length) card("Held-out residual", `${(100 * Math.min(...trials)).toFixed(1)} %`, quality + "of pairs not fitted, short fit");
  else card("Residual", last != null ? `${(100 * last).toFixed(1)} %` : "–", "of fitted pairs");
  card("Solve time", `${totals.solve_s.toFixed(1)} s`, report.device.name.trim());
  card("Warnings", String(warnings.length));
  const list = (id, lines) => lines.forEach(line => { const item = document.createElement("li"); item.innerText = line, element(id).append(item); });
  list("warnings", warnings);
  element("about").innerText = `${data.light.all_pairs} pairs of ${data.light.all_bins} bins, ${nx} x ${ny} pixels, ${found.all} of them surface; `
    + `solver ${settings.solver}, model ${settings.model}; thirdbounce ${report.version}.`;
  for (const [name, value] of Object.entries(settings)) {
    const row = element("settings").insertRow(), head = document.createElement("th");
    head.scope = "row", head.innerText = name, row.append(head);
    row.insertCell().innerText = typeof value === "string" ? value : JSON.stringify(value);
  }
  const candidates = settings.candidates || [];
  element("candidates-box").hidden = !candidates.length;
  for (const { reflectance, start, left, seconds, kept } of candidates) {
    const row = element("candidates").insertRow(), [share, error, excess] = left.map(v => v == null ? "–" : (100 * v).toPrecision(3));
    for (const text of [reflectance, start === "closed" ? "closed form" : "coarse volume", `${share} ± ${error} %`, `${excess} %`, seconds.toFixed(2), kept ? "kept" : ""]) row.insertCell().innerText = text;
  }
  const stages = totals.stages || [], spent = stages.reduce((sum, { seconds }) => sum + seconds, 0);
  element("stages-box").hidden = !stages.length;
  for (const { name, seconds } of stages) {
    const row = element("stages").insertRow();
    for (const text of [name, seconds.toFixed(2), `${Math.round(100 * seconds / spent)} %`]) row.insertCell().innerText = text;
  }
  list("left", report.plan.left_out), list("notes", settings.notes?.length ? settings.notes : ["none"]);
}

words(), pictures();
try { space(); } catch (error) { element("space").innerText = `no 3D view: ${error.message}`; }
// Initially the brightest of the more certain half of the pixels.
const certain = depth_error ? quantile(depth_error, .5, isSurface) : 0;
const first = Array.from(albedo.keys()).filter(i => isSurface(i) && !(depth_error && depth_error[i] > certain)).sort((a, b) => albedo[b] - albedo[a])[0];
if (first !== undefined) choose(first);
