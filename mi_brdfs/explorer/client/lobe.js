// The lobe as a body to turn, drawn by WebGL; the arrow of wi can be dragged.
import { block, clamp, decades, degrees, element, format, largest, onArrows, radians, rgbOf, subscripted, wrapped } from "./util.js";
import { ARROW, cross, dot, furniture, makeBody, scaled, sum, unit } from "./geometry.js";
import { session, visible } from "./session.js";
import { cards, tell } from "./card.js";
import { aimAt } from "./link.js";
import { colourOf } from "./drawing.js";
import { quantity } from "./plots.js";

const VERTEX = `#version 300 es
in vec3 position, normal; uniform mat4 view; out vec3 facing;
void main() { facing = normal; gl_Position = view * vec4(position, 1.0); }`;
const FRAGMENT = `#version 300 es
precision mediump float; in vec3 facing; uniform vec4 colour; uniform vec3 eye; uniform float lit; out vec4 seen;
void main() {
  float light = mix(1.0, 0.45 + 0.6 * abs(dot(normalize(facing + vec3(1e-6)), eye)), lit);
  seen = vec4(colour.rgb * light * colour.a, colour.a);
}`;
const camera = { yaw: 1.87, pitch: 0.42, distance: 3.8 };
let gl, program, canvas, labels, places, edges;
const bodies = new Map();

/** Put the canvas into its card. */
export function startLobe() {
  const card = cards.lobe;
  canvas = element("canvas", { tabindex: 0, role: "img" });
  gl = canvas.getContext("webgl2", { antialias: false, premultipliedAlpha: true, preserveDrawingBuffer: true });
  if (!gl) {
    card.figure.append(
      element("p", {}, "This browser has no WebGL 2, which the lobe needs; the polar plot shows its cut."),
    );
    return;
  }
  card.legend = [
    [null, "Drag ωi to move it, or elsewhere to rotate. Arrow keys rotate; Shift+arrows move ωi."],
  ];
  tell(card, []);
  labels = block("labels");
  card.figure.append(canvas, labels);
  setUp();
  canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
  canvas.addEventListener("webglcontextrestored", () => {
    bodies.clear();
    setUp();
    drawLobe();
  });
  listen();
}

function setUp() {
  program = gl.createProgram();
  for (const [kind, source] of [
    [gl.VERTEX_SHADER, VERTEX],
    [gl.FRAGMENT_SHADER, FRAGMENT],
  ]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.bindAttribLocation(program, 0, "position");
  gl.bindAttribLocation(program, 1, "normal");
  gl.linkProgram(program);
  gl.useProgram(program);
  gl.clearColor(0, 0, 0, 0);
  gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  const named = gl.getExtension("WEBGL_debug_renderer_info")?.UNMASKED_RENDERER_WEBGL ?? gl.RENDERER;
  const slow = /swiftshader|llvmpipe|softpipe|basic render/i.test(gl.getParameter(named));
  edges = { frame: gl.createFramebuffer(), buffers: [gl.createRenderbuffer(), gl.createRenderbuffer()], slow };
}

function upload({ position, normal, faces, lines }) {
  const made = { array: gl.createVertexArray(), faces: faces.length, lines: lines.length, buffers: [] };
  gl.bindVertexArray(made.array);
  const buffer = (target, data) => {
    made.buffers.push(gl.createBuffer());
    gl.bindBuffer(target, made.buffers[made.buffers.length - 1]);
    gl.bufferData(target, data, gl.STATIC_DRAW);
  };
  [position, normal].forEach((data, k) => {
    buffer(gl.ARRAY_BUFFER, data);
    gl.enableVertexAttribArray(k);
    gl.vertexAttribPointer(k, 3, gl.FLOAT, false, 0, 0);
  });
  const both = new Uint32Array(faces.length + lines.length);
  both.set(faces);
  both.set(lines, faces.length);
  buffer(gl.ELEMENT_ARRAY_BUFFER, both);
  return made;
}

function discard(body) {
  gl.deleteVertexArray(body.array);
  body.buffers.forEach((buffer) => gl.deleteBuffer(buffer));
}

/** Return the camera: its place, its axes, and its matrix by columns. */
function look(aspect) {
  const { yaw, pitch, distance } = camera;
  const back = [Math.cos(pitch) * Math.cos(yaw), Math.cos(pitch) * Math.sin(yaw), Math.sin(pitch)];
  const target = [0, 0, places.whole ? 0 : 0.25];
  const right = [-Math.sin(yaw), Math.cos(yaw), 0];
  const up = cross(back, right);
  const far = distance * Math.max(1, 1 / aspect) * (places.whole ? 1.25 : 1);
  const eye = sum(target, scaled(back, far));
  const zoom = 1 / Math.tan(radians(16));
  const [near, end] = [0.1, 40];
  const depth = (end + near) / (near - end);
  const rows = [
    [...scaled(right, zoom / aspect), -dot(right, eye) * (zoom / aspect)],
    [...scaled(up, zoom), -dot(up, eye) * zoom],
    [...scaled(back, depth), -dot(back, eye) * depth + (2 * end * near) / (near - end)],
    [...scaled(back, -1), dot(back, eye)],
  ];
  const matrix = new Float32Array(16);
  rows.forEach((row, i) => row.forEach((value, j) => (matrix[4 * j + i] = value)));
  return { eye, back, right, up, zoom, aspect, matrix };
}

function project({ matrix }, [x, y, z], [left, top, width, height]) {
  const at = [0, 1, 3].map((i) => matrix[i] * x + matrix[4 + i] * y + matrix[8 + i] * z + matrix[12 + i]);
  return [left + (0.5 + (0.5 * at[0]) / at[2]) * width, top + (0.5 - (0.5 * at[1]) / at[2]) * height];
}

export function drawLobe() {
  if (!gl || gl.isContextLost()) return;
  const card = cards.lobe;
  const { state } = session;
  const found = visible()
    .filter((k) => session.shown.lobe[k])
    .map((k) => ({ subject: k, parts: session.shown.lobe[k].parts }));
  const arrays = found.map(({ parts }) => parts.map(({ values }) => values));
  const peaks = arrays.map((values) => largest(values));
  const common = Math.max(...peaks, 0) || 1;
  const log = state.scale === "log";
  const over = arrays.map((values, k) => (state.normalise ? peaks[k] : common));
  const [low, high] = log
    ? decades(
        arrays.flatMap((values, k) => values.map((part) => part.map((value) => value / over[k]))),
        1,
      )
    : [0, 1];
  const used = new Set();
  found.forEach(({ subject, parts }, k) => {
    const radius = (value) => {
      const share = value / over[k];
      return !(share > 0) ? 0 : Math.min(log ? Math.max((Math.log10(share) - low) / (high - low), 0) : share, 1);
    };
    for (const [at, part] of parts.entries()) {
      const slot = `${subject} ${at}`;
      const stamp = `${over[k]} ${low} ${log}`;
      used.add(slot);
      const before = bodies.get(slot);
      if (before?.stamp === stamp && before.of === part) continue;
      if (before) discard(before);
      bodies.set(slot, Object.assign(upload(makeBody(part, at > 0, radius)), { stamp, of: part }));
    }
  });
  for (const [slot, body] of bodies) {
    if (used.has(slot)) continue;
    discard(body);
    bodies.delete(slot);
  }
  render(found);
  canvas.setAttribute(
    "aria-label",
    `Lobes of ${quantity()} at θi ${format(state.theta)}°: ${found
      .map(({ subject }, k) => `${state.subjects[subject].name}, at most ${format(peaks[k])} per steradian`)
      .join("; ")}. Arrow keys turn it.`,
  );
  card.note.replaceChildren(
    ...subscripted(`${quantity()} as radius`),
    log ? `, logarithmic from ${format(10 ** low * (state.normalise ? 1 : common), 2)}` : "",
    state.normalise ? ", over their peaks" : `, at most ${format(common)}`,
  );
}

/** Return the canvas, just drawn, or null without WebGL. */
export function lobeImage() {
  drawLobe();
  return gl && canvas;
}

function render(found) {
  const { state } = session;
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (!width) return;
  if (canvas.width !== Math.round(width * ratio)) canvas.width = Math.round(width * ratio);
  if (canvas.height !== Math.round(height * ratio)) canvas.height = Math.round(height * ratio);
  const side = state.lobes === "side" && found.length > 1;
  const columns = side ? (found.length > 2 || width > height ? 2 : 1) : 1;
  const rows = side ? Math.ceil(found.length / columns) : 1;
  const areas = (side ? found : [found]).map((_, k) => [
    ((k % columns) * width) / columns,
    (Math.floor(k / columns) * height) / rows,
    width / columns,
    height / rows,
  ]);
  places = { areas, whole: found.some(({ parts }) => parts.length > 1) };
  const wi = unit(state.theta, state.phi);
  const things = upload(furniture(wi));
  const ink = getComputedStyle(canvas)
    .color.match(/[\d.]+/g)
    .slice(0, 3)
    .map((value) => value / 255);
  const show = smooth();
  gl.viewport(0, 0, canvas.width, canvas.height);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  labels.replaceChildren();
  areas.forEach((area, at) => {
    gl.viewport(area[0] * ratio, canvas.height - (area[1] + area[3]) * ratio, area[2] * ratio, area[3] * ratio);
    const view = look(area[2] / area[3]);
    places.view = view;
    gl.uniformMatrix4fv(gl.getUniformLocation(program, "view"), false, view.matrix);
    gl.uniform3fv(gl.getUniformLocation(program, "eye"), view.back);
    const paint = (body, colour, alpha, lit, mode = "faces") => {
      gl.bindVertexArray(body.array);
      gl.uniform4f(gl.getUniformLocation(program, "colour"), ...colour, alpha);
      gl.uniform1f(gl.getUniformLocation(program, "lit"), lit);
      if (mode === "faces") gl.drawElements(gl.TRIANGLES, body.faces, gl.UNSIGNED_INT, 0);
      else gl.drawElements(gl.LINES, body.lines, gl.UNSIGNED_INT, 4 * body.faces);
    };
    gl.enable(gl.DEPTH_TEST);
    gl.enable(gl.BLEND);
    paint(things, ink, 0.75, 0);
    paint(things, ink, 0.4, 0, "lines");
    const shown = side ? [found[at]] : found;
    for (const [place, { subject, parts }] of shown.entries()) {
      const colour = rgbOf(colourOf(subject));
      const faded = session.info[subject]?.error ? 0.3 : 1;
      // One is a body and the others are wires in front of it: seen through each other, two would mix their colours.
      const solid = place === 0 && !state.wire;
      gl.depthMask(solid && faded === 1);
      if (!solid) gl.disable(gl.DEPTH_TEST);
      for (const at of parts.keys()) {
        const body = bodies.get(`${subject} ${at}`);
        if (solid) paint(body, colour, 0.94 * faded, 1);
        else paint(body, colour, 0.6 * faded, 0, "lines");
      }
    }
    gl.depthMask(true);
    const mark = (text, point, kind) => {
      const [x, y] = project(view, point, area);
      labels.append(element("span", { class: kind, style: `left:${x}px;top:${y}px` }, ...subscripted(text)));
    };
    mark("ωi", scaled(wi, ARROW + 0.17), "direction");
    mark("n", [0, 0, 1.15], "");
    mark("u", [1.07, 0, 0], "");
    if (side) mark(state.subjects[found[at].subject].name, places.whole ? [0, 0, -1.3] : [0, 0, -0.4], "name");
  });
  discard(things);
  show();
}

/** Draw with smooth edges from here on, and return what shows it; without them under a hand that drags, where there is
 * no graphics processor: they take most of the time then. */
function smooth() {
  if (session.dragged && edges.slow) return () => {};
  const { width, height } = canvas;
  gl.bindFramebuffer(gl.FRAMEBUFFER, edges.frame);
  if (edges.width !== width || edges.height !== height) {
    Object.assign(edges, { width, height });
    for (const [k, [format, place]] of [
      [gl.RGBA8, gl.COLOR_ATTACHMENT0],
      [gl.DEPTH_COMPONENT24, gl.DEPTH_ATTACHMENT],
    ].entries()) {
      gl.bindRenderbuffer(gl.RENDERBUFFER, edges.buffers[k]);
      gl.renderbufferStorageMultisample(gl.RENDERBUFFER, 4, format, width, height);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, place, gl.RENDERBUFFER, edges.buffers[k]);
    }
  }
  return () => {
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, null);
    gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  };
}

const again = () => requestAnimationFrame(drawLobe);

function listen() {
  const fingers = new Map();
  let dragged = null;
  const local = (event) => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  const areaAt = ([x, y]) =>
    places?.areas.find(([left, top, width, height]) => x >= left && y >= top && x < left + width && y < top + height);
  const nearTip = (point, reach) => {
    const area = areaAt(point);
    if (!area) return null;
    // Between the tip and its label: both are taken hold of.
    const tip = project(places.view, scaled(unit(session.state.theta, session.state.phi), ARROW + 0.08), area);
    return Math.hypot(point[0] - tip[0], point[1] - tip[1]) < reach ? area : null;
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, local(event));
    dragged = nearTip(local(event), event.pointerType === "touch" ? 40 : 24);
  });
  // A thumb that scrolls the page past the lobe neither turns it nor moves wi; one on wi does not scroll.
  const hold = (event) => (dragged || event.touches.length > 1) && event.preventDefault();
  canvas.addEventListener("touchstart", hold, { passive: false });
  canvas.addEventListener("pointermove", (event) => {
    const point = local(event);
    const before = fingers.get(event.pointerId);
    canvas.style.cursor = dragged || (!before && nearTip(point, 24)) ? "pointer" : "grab";
    if (!before) return;
    if (dragged) {
      aim(point, dragged);
    } else if (fingers.size === 2) {
      const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
      const gap = (a) => Math.hypot(a[0] - other[0], a[1] - other[1]);
      zoomBy(gap(before) / Math.max(gap(point), 1));
    } else {
      turn((before[0] - point[0]) / 140, (point[1] - before[1]) / 140);
    }
    fingers.set(event.pointerId, point);
  });
  for (const end of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(end, (event) => {
      fingers.delete(event.pointerId);
      dragged = null;
      again();
    });
  }
  canvas.addEventListener(
    "wheel",
    (event) => {
      if (!event.ctrlKey && document.activeElement !== canvas) return;
      event.preventDefault();
      zoomBy(Math.exp(event.deltaY / 600));
    },
    { passive: false },
  );
  canvas.addEventListener("keydown", (event) => {
    if (event.key === "+" || event.key === "-") zoomBy(event.key === "+" ? 0.9 : 1.1);
  });
  onArrows(canvas, (right, up, { shiftKey }) => {
    if (!shiftKey) return turn(0.1 * right, 0.1 * up);
    const { theta, phi } = session.state;
    aimAt(theta - (session.exported ? 10 : 2) * up, wrapped(phi + 5 * right));
  });
}

function turn(yaw, pitch) {
  camera.yaw += yaw;
  camera.pitch = clamp(camera.pitch + pitch, -0.3, 1.5);
  again();
}

function zoomBy(factor) {
  camera.distance = clamp(camera.distance * factor, 1.5, 12);
  again();
}

/** Point wi to where the pointer's ray meets the sphere of its tip, at the side where the tip is. */
function aim([x, y], [left, top, width, height]) {
  const { eye, back, right, up, zoom, aspect } = places.view;
  const [u, v] = [(2 * (x - left)) / width - 1, 1 - (2 * (y - top)) / height];
  let ray = sum(scaled(back, -1), sum(scaled(right, (u * aspect) / zoom), scaled(up, v / zoom)));
  ray = scaled(ray, 1 / Math.hypot(...ray));
  const along = -dot(eye, ray);
  const nearest = sum(eye, scaled(ray, along));
  const inside = ARROW * ARROW - dot(nearest, nearest);
  const half = Math.sqrt(Math.max(inside, 0));
  const tip = unit(session.state.theta, session.state.phi);
  const candidates = [along - half, along + half]
    .map((t) => sum(eye, scaled(ray, t)))
    .filter((point) => point[2] > 0 || inside <= 0);
  const way = candidates.sort((a, b) => dot(b, tip) / Math.hypot(...b) - dot(a, tip) / Math.hypot(...a))[0];
  if (!way) return;
  const theta = degrees(Math.atan2(Math.hypot(way[0], way[1]), Math.max(way[2], 0.001)));
  const phi = degrees(Math.atan2(way[1], way[0]));
  aimAt(Math.round(theta * 10) / 10, theta < 1 ? session.state.phi : Math.round(phi * 10) / 10);
}
