"use strict";
// A result as one page. `data` is written by src/export/page: maps quantised to 16 bits, histograms to 16 bits, the report.
const data = JSON.parse(document.getElementById("data").textContent);
const element = id => document.getElementById(id);
const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer;

// 16 bits over a range; the largest value means that nothing is there.
function numbers({ low, high, values }) {
  const words = new Uint16Array(bytes(values));
  return Float32Array.from(words, w => w === 65535 ? NaN : low + (high - low) * w / 65534);
}

const { nx, ny, extent } = data.maps;
const albedo = numbers(data.maps.albedo), depth = numbers(data.maps.depth);
const confidence = data.maps.confidence && numbers(data.maps.confidence);
const normal = Float32Array.from(new Int8Array(bytes(data.maps.normal)), v => v / 127);
const mask = new Uint8Array(bytes(data.maps.mask));
const counts = numbers(data.light.counts);
const { bins, bin_width, t_start, laser, sensor, laser_scans, pulse } = data.light;
const pairs = laser.length / 3;
const pixel = [(extent[1] - extent[0]) / nx, (extent[3] - extent[2]) / ny];
const place = i => [extent[0] + (Math.floor(i / ny) + .5) * pixel[0], extent[2] + (i % ny + .5) * pixel[1], depth[i]];

// Colours.
const VIRIDIS = [[68, 1, 84], [71, 44, 122], [59, 81, 139], [44, 113, 142], [33, 144, 141], [39, 173, 129], [92, 200, 99], [170, 220, 50], [253, 231, 37]];
function viridis(share) {
  const at = Math.min(Math.max(share, 0), 1) * (VIRIDIS.length - 1), i = Math.min(Math.floor(at), VIRIDIS.length - 2);
  return VIRIDIS[i].map((v, c) => v + (VIRIDIS[i + 1][c] - v) * (at - i));
}
function range(values, keep = () => true) {
  const sorted = Array.from(values).filter((v, i) => Number.isFinite(v) && keep(i)).sort((a, b) => a - b);
  const at = share => sorted[Math.round(share * (sorted.length - 1))];
  return sorted.length ? [at(.01), at(.99)] : [0, 1];
}
const share = ([low, high], v) => high > low ? (v - low) / (high - low) : .5;
const isSurface = i => mask[i] === 1 && Number.isFinite(depth[i]);
const bright = range(albedo), far = range(depth, isSurface), sure = confidence && range(confidence, isSurface);
const DARK = [20, 20, 26];
const maps = [
  ["Albedo", i => { const v = 255 * Math.min(Math.max(albedo[i] / bright[1], 0), 1); return [v, v, v]; }],
  ["Depth", i => isSurface(i) ? viridis(1 - share(far, depth[i])) : DARK],
  ["Normals", i => isSurface(i) ? [-1, 1, -1].map((sign, c) => 127.5 * (1 + sign * normal[3 * i + c])) : DARK],
];
if (confidence) maps.push(["Confidence", i => isSurface(i) ? viridis(share(sure.map(Math.log), Math.log(confidence[i]))) : DARK]);

// The maps, as an eye at the wall sees them: x to the left, y up.
const scale = 350 / Math.max(nx, ny);
const column = i => nx - 1 - Math.floor(i / ny);
let chosen = -1, kept = false, pair = 0;
const canvases = maps.map(([name, colour]) => {
  const figure = document.createElement("figure"), canvas = document.createElement("canvas");
  canvas.width = nx, canvas.height = ny;
  canvas.style.width = `${nx * scale}px`, canvas.style.height = `${ny * scale}px`;
  const picture = new ImageData(nx, ny);
  for (let i = 0; i < nx * ny; i++) picture.data.set([...colour(i), 255], 4 * ((ny - 1 - i % ny) * nx + column(i)));
  const caption = document.createElement("figcaption");
  caption.innerText = name;
  figure.append(canvas, caption);
  element("maps").append(figure);
  const at = event => {
    const box = canvas.getBoundingClientRect();
    const x = nx - 1 - Math.floor((event.clientX - box.left) / scale), y = ny - 1 - Math.floor((event.clientY - box.top) / scale);
    return x >= 0 && x < nx && y >= 0 && y < ny ? x * ny + y : -1;
  };
  canvas.onmousemove = event => { if (!kept) choose(at(event)); };
  canvas.onclick = event => { kept = !kept || at(event) !== chosen; choose(at(event)); };
  return [canvas, picture];
});

function drawMaps() {
  for (const [canvas, picture] of canvases) {
    const context = canvas.getContext("2d");
    context.putImageData(picture, 0, 0);
    if (chosen < 0) continue;
    const x = column(chosen), y = ny - 1 - chosen % ny;
    context.fillStyle = "rgba(255, 80, 60, .75)";
    context.fillRect(x, 0, 1, y), context.fillRect(x, y + 1, 1, ny), context.fillRect(0, y, x, 1), context.fillRect(x + 1, y, nx, 1);
  }
}

function choose(i) {
  chosen = i;
  drawMaps(), drawHistogram(), mark();
  if (i < 0) return;
  const [x, y] = place(i), metres = v => `${v.toFixed(4)} m`;
  const angle = Math.acos(Math.min(1, -normal[3 * i + 2])) * 180 / Math.PI;
  element("readout").innerText = `x ${metres(x)}, y ${metres(y)}, pixel ${Math.floor(i / ny)}, ${i % ny}: albedo ${albedo[i].toPrecision(3)}`
    + (isSurface(i) ? `, depth ${metres(depth[i])}` + (confidence ? ` ± ${(1000 * confidence[i]).toFixed(1)} mm` : "")
      + `\nnormal ${[0, 1, 2].map(c => normal[3 * i + c].toFixed(2)).join(", ")}: ${angle.toFixed(0)}° from the wall's` : ", no surface");
}

// Light.
const arm = (points, p, at) => Math.hypot(points[3 * p] - at[0], points[3 * p + 1] - at[1], points[3 * p + 2] - at[2]);
const path = (p, at) => arm(laser, p, at) + arm(sensor, p, at);

// The light of the surface in a pair's bins, by the reflectance that was used, without a scale.
function rendered(p) {
  const light = new Float32Array(bins), model = data.report.settings.model;
  const scanned = laser_scans ? laser : sensor;
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
  return pulse > bin_width ? blurred(light, pulse / bin_width / 2.355) : light;
}
function blurred(light, sigma) {
  const reach = Math.ceil(3 * sigma), taps = [];
  for (let k = -reach; k <= reach; k++) taps.push(Math.exp(-.5 * (k / sigma) ** 2));
  const sum = taps.reduce((a, b) => a + b, 0);
  return light.map((_, bin) => taps.reduce((s, w, k) => s + w / sum * (light[bin + k - reach] || 0), 0));
}
const measured = p => counts.subarray(p * bins, (p + 1) * bins);

// One scale for all pairs, so that each shows what is too bright or too dim.
const fit = (() => {
  let own = 0, both = 0;
  for (let k = 0; k < Math.min(pairs, 49); k++) {
    const p = Math.floor((k + .5) * pairs / Math.min(pairs, 49)), light = rendered(p), found = measured(p);
    for (let bin = 0; bin < bins; bin++) own += light[bin] ** 2, both += light[bin] * found[bin];
  }
  return own > 0 ? Math.max(both / own, 0) : 0;
})();

function drawHistogram() {
  const canvas = element("histogram"), context = canvas.getContext("2d"), { width, height } = canvas;
  const found = measured(pair), light = rendered(pair).map(v => fit * v);
  const most = Math.max(...found, ...light, 1e-30), x = bin => bin / bins * width, y = v => height - 8 - (height - 20) * v / most;
  context.clearRect(0, 0, width, height);
  context.fillStyle = "#5f7fbf";
  found.forEach((v, bin) => context.fillRect(x(bin), y(v), Math.max(1, width / bins - .3), height - 8 - y(v)));
  context.strokeStyle = "#ffb347", context.lineWidth = 1.5;
  context.beginPath();
  light.forEach((v, bin) => context.lineTo(x(bin + .5), y(v)));
  context.stroke();
  if (chosen >= 0 && isSurface(chosen)) {
    const at = (path(pair, place(chosen)) - t_start) / bin_width;
    context.fillStyle = "#ff503c";
    context.fillRect(x(at) - 1, 0, 2, height);
  }
  const points = [laser, sensor].map(p => `(${[0, 1, 2].map(c => p[3 * pair + c].toFixed(3)).join(", ")})`);
  element("light").innerText = `Pair ${pair + 1} of ${pairs} shown, laser ${points[0]}, sensor ${points[1]} m: `
    + `measured (bars) and light of the maps (line), ${t_start.toFixed(2)} to ${(t_start + bins * bin_width).toFixed(2)} m of path, `
    + `at most ${most.toPrecision(3)} in a bin; red: the path over the pixel`;
}

// The wall.
const wall = element("wall"), moving = laser_scans ? laser : sensor;
const box = [0, 1].map(c => { const all = Array.from({ length: pairs }, (_, p) => moving[3 * p + c]); return [Math.min(...all), Math.max(...all)]; });
const reach = Math.max(box[0][1] - box[0][0], box[1][1] - box[1][0]) || 1, dot = Math.max(3, .85 * 280 / Math.sqrt(pairs));
const onWall = p => [10 + 280 * (box[0][1] - moving[3 * p]) / reach, 290 - 280 * (moving[3 * p + 1] - box[1][0]) / reach];
const apart = (p, at) => Math.hypot(onWall(p)[0] - at[0], onWall(p)[1] - at[1]);
const nearest = at => { let best = 0; for (let p = 0; p < pairs; p++) if (apart(p, at) < apart(best, at)) best = p; return best; };
pair = nearest([150, 150]);
function drawWall() {
  const context = wall.getContext("2d"), totals = Array.from({ length: pairs }, (_, p) => measured(p).reduce((a, b) => a + b, 0));
  const most = Math.max(...totals, 1e-30);
  context.clearRect(0, 0, 300, 300);
  totals.forEach((total, p) => {
    const [x, y] = onWall(p), v = 255 * Math.sqrt(Math.max(total, 0) / most);
    context.fillStyle = p === pair ? "#ff503c" : `rgb(${v},${v},${v})`;
    context.fillRect(x - dot / 2, y - dot / 2, dot, dot);
  });
}
wall.onclick = event => {
  const at = wall.getBoundingClientRect();
  pair = nearest([event.clientX - at.left, event.clientY - at.top]);
  drawWall(), drawHistogram(), mark();
};

// The surface in space, turned half round about y: depth runs away from the viewer, who stands at the wall.
let mark = () => {};
function space() {
  const holder = element("space"), scene = new THREE.Scene(), renderer = new THREE.WebGLRenderer({ antialias: true });
  renderer.setSize(700, 460);
  holder.append(renderer.domElement);
  scene.background = new THREE.Color(0x1c1c24);
  const number = new Int32Array(nx * ny).fill(-1), positions = [], colours = [], corners = [];
  for (let i = 0; i < nx * ny; i++) {
    if (!isSurface(i)) continue;
    number[i] = positions.length / 3;
    const [x, y, z] = place(i), v = .25 + .75 * Math.sqrt(Math.min(Math.max(albedo[i] / bright[1], 0), 1));
    positions.push(-x, y, -z), colours.push(v, v, v);
  }
  const step = 4 * Math.max(...pixel), near = (...all) => all.every(i => number[i] >= 0) && Math.max(...all.map(i => depth[i])) - Math.min(...all.map(i => depth[i])) < step;
  for (let x = 0; x + 1 < nx; x++) for (let y = 0; y + 1 < ny; y++) {
    const [a, b, c, d] = [x * ny + y, (x + 1) * ny + y, (x + 1) * ny + y + 1, x * ny + y + 1];
    if (near(a, b, c)) corners.push(number[a], number[c], number[b]);
    if (near(a, c, d)) corners.push(number[a], number[d], number[c]);
  }
  const shape = new THREE.BufferGeometry();
  shape.setAttribute("position", new THREE.BufferAttribute(new Float32Array(positions), 3));
  shape.setAttribute("color", new THREE.BufferAttribute(new Float32Array(colours), 3));
  const cloud = new THREE.Points(shape, new THREE.PointsMaterial({ size: .8 * Math.min(...pixel), vertexColors: true }));
  const solid = shape.clone();
  solid.setIndex(corners), solid.computeVertexNormals();
  const mesh = new THREE.Mesh(solid, new THREE.MeshLambertMaterial({ vertexColors: true, side: THREE.DoubleSide }));
  const sun = new THREE.DirectionalLight(0xffffff, 2.2);
  sun.position.set(-.6, .8, 1.5);
  scene.add(cloud, mesh, sun, new THREE.AmbientLight(0xffffff, .5));
  cloud.visible = false;
  const [x0, x1, y0, y1] = extent, frame = new THREE.BufferGeometry();
  frame.setAttribute("position", new THREE.BufferAttribute(new Float32Array([-x0, y0, 0, -x1, y0, 0, -x1, y0, 0, -x1, y1, 0, -x1, y1, 0, -x0, y1, 0, -x0, y1, 0, -x0, y0, 0]), 3));
  scene.add(new THREE.LineSegments(frame, new THREE.LineBasicMaterial({ color: 0x777788 })));
  const rays = new THREE.BufferGeometry(), ends = new THREE.BufferAttribute(new Float32Array(12), 3);
  rays.setAttribute("position", ends);
  const lines = new THREE.LineSegments(rays, new THREE.LineBasicMaterial({ color: 0xff503c }));
  lines.visible = false, lines.frustumCulled = false;
  scene.add(lines);
  const middle = new THREE.Vector3(-(x0 + x1) / 2, (y0 + y1) / 2, -(far[0] + far[1]) / 2), wide = Math.max(x1 - x0, y1 - y0);
  const camera = new THREE.PerspectiveCamera(40, 700 / 460, .001 * wide, 100 * wide);
  camera.position.set(middle.x - .6 * wide, middle.y + .4 * wide, .55 * wide);
  const controls = new THREE.OrbitControls(camera, renderer.domElement), draw = () => renderer.render(scene, camera);
  controls.target.copy(middle), controls.update();
  controls.addEventListener("change", draw);
  element("as").onclick = () => {
    [cloud.visible, mesh.visible] = [mesh.visible, cloud.visible];
    element("as").innerText = mesh.visible ? "points" : "mesh";
    draw();
  };
  mark = () => {
    lines.visible = chosen >= 0 && isSurface(chosen);
    if (lines.visible) {
      const [x, y, z] = place(chosen);
      [laser, sensor].forEach((points, k) => ends.array.set([-points[3 * pair], points[3 * pair + 1], -points[3 * pair + 2], -x, y, -z], 6 * k));
      ends.needsUpdate = true;
    }
    draw();
  };
  draw();
}

// The trace.
function drawTrace() {
  const canvas = element("trace"), context = canvas.getContext("2d"), { width, height } = canvas, trace = data.report.trace.filter(t => t.loss > 0);
  if (!trace.length) return;
  const end = trace.at(-1).seconds || 1, x = t => 8 + (width - 16) * t.seconds / end;
  const active = Math.max(...trace.map(t => t.active)), logs = trace.map(t => Math.log(t.loss)), [low, high] = [Math.min(...logs), Math.max(...logs)];
  context.fillStyle = "#2f4a3f";
  context.beginPath(), context.moveTo(x(trace[0]), height - 8);
  trace.forEach(t => context.lineTo(x(t), height - 8 - (height - 30) * t.active / active));
  context.lineTo(x(trace.at(-1)), height - 8), context.fill();
  context.strokeStyle = "#ffb347", context.lineWidth = 1.5;
  context.beginPath();
  trace.forEach((t, i) => context.lineTo(x(t), height - 8 - (height - 30) * share([low, high], logs[i])));
  context.stroke();
  context.fillStyle = "#b8b8c4", context.font = "12px sans-serif";
  context.fillText(`loss ${Math.exp(high).toPrecision(2)} to ${Math.exp(low).toPrecision(2)}, at most ${active} active voxels, ${end.toFixed(2)} s`, 10, 14);
}

// Words.
function words() {
  const { report } = data, surface = mask.reduce((n, m) => n + m, 0);
  element("title").innerText = data.title;
  const figures = report.metrics && report.metrics.depth_mae != null ? `; against the truth: depth error ${(1000 * report.metrics.depth_mae).toFixed(1)} mm` : "";
  element("about").innerText = `${data.light.all_pairs} pairs of ${data.light.all_bins} bins, ${nx} x ${ny} pixels, ${surface} of them surface, `
    + `solved in ${report.totals.solve_s.toFixed(1)} s on ${report.device.name.trim()} (thirdbounce ${report.version})${figures}`;
  const rows = (table, all) => Object.entries(all).forEach(([name, value]) => {
    const row = table.insertRow();
    row.insertCell().innerText = name;
    row.insertCell().innerText = typeof value === "string" ? value : JSON.stringify(value);
  });
  rows(element("settings"), report.settings);
  element("left").innerText = report.plan.left_out.join("\n");
  const told = [["Warnings", report.warnings || []], ["Notes", report.settings.notes || []]];
  element("notes").innerText = told.filter(([, all]) => all.length).map(([name, all]) => [name, ...all].join("\n")).join("\n\n");
}

words(), drawMaps(), drawWall(), drawHistogram(), drawTrace();
try { space(); } catch (error) { element("space").innerText = `no 3D view: ${error.message}`; }
const first = Array.from(albedo.keys()).filter(isSurface).sort((a, b) => albedo[b] - albedo[a])[0];
if (first !== undefined) choose(first);
