// The pictures: side by side, wiped over each other, or their difference.
import { block, clamp, element, format, fromDisplay, onArrows, onPointer, wrapped } from "./util.js";
import { change, session, visible } from "./session.js";
import { cards, tell } from "./card.js";
import { colourOf } from "./drawing.js";

const SIZES = [128, 192, 256, 384, 512];
const canvases = new Map();
let stack, divider;

export function startPicture() {
  const card = cards.picture;
  stack = block("pictures");
  divider = element("input", {
    type: "range",
    class: "divider",
    min: 0,
    max: 1,
    step: 0.01,
    "aria-label": "Divider between the two pictures",
    oninput: () => change({ wipe: divider.valueAsNumber }),
  });
  card.figure.append(stack);
  if (!session.exported) card.legend = [[null, "Drag or use the arrow keys to orbit; double-click to reset."]];
  tell(card, []);
}

/** Return the size in pixels to ask for: what the layout shows, as far as pictures can follow edits. */
export function wantedSize() {
  const frame = stack?.querySelector(".frame");
  const shown = Math.max(frame?.clientWidth ?? 0, frame?.clientHeight ?? 0) || 256;
  return SIZES.findLast((size) => size <= shown * (window.devicePixelRatio || 1) * 1.05) ?? SIZES[0];
}

const modeOf = () => (visible().length < 2 ? "side" : session.state.compare);

/** Return the two subjects that are compared. */
export function pairOf() {
  const seen = visible();
  const [a, b] = session.state.pair;
  return a !== b && seen.includes(a) && seen.includes(b) ? [a, b] : seen.slice(0, 2);
}

export function drawPicture() {
  const mode = modeOf();
  const shown = mode === "side" ? visible() : pairOf();
  const layout = `${mode} ${shown.join()}`;
  if (stack.dataset.layout !== layout) build(mode, shown, layout);
  for (const k of shown) {
    const answer = session.shown.picture[k];
    const canvas = canvases.get(k);
    if (answer && canvas.answer !== answer) put(canvas, answer);
    else if (!answer) canvas.width = canvas.width;
    canvas.classList.toggle("awaited", !answer && !session.info[k]?.error);
    canvas.closest(".frame").classList.toggle("dimmed", Boolean(session.info[k]?.error));
    canvas.setAttribute(
      "aria-label",
      `${session.state.subjects[k].name}, rendered in the light ${session.state.stage}`,
    );
    const caption = stack.querySelector(`[data-subject="${k}"]`);
    caption.querySelector("b").textContent = session.state.subjects[k].name;
    caption.style.setProperty("--mark", colourOf(k));
    caption.querySelector("small").textContent = answer
      ? `${answer.spp} spp${answer.denoised ? ", denoised" : ""}`
      : "";
  }
  if (mode === "wipe") {
    const { wipe } = session.state;
    stack.style.setProperty("--wipe", wipe);
    divider.value = wipe;
    divider.setAttribute(
      "aria-valuetext",
      `${session.state.subjects[shown[0]].name} up to ${Math.round(100 * wipe)}\u00a0%`,
    );
  }
  if (mode === "difference") drawDifference(shown);
}

function build(mode, shown, layout) {
  stack.dataset.layout = layout;
  cards.picture.node.classList.toggle("wide", mode === "side" && shown.length > 1);
  stack.className = `pictures ${mode} of-${mode === "side" ? shown.length : 1}`;
  for (const k of shown) if (!canvases.has(k)) canvases.set(k, makeCanvas(k));
  const caption = (k) => element("figcaption", { "data-subject": k, class: "marked" }, element("b"), element("small"));
  if (mode === "side") {
    stack.replaceChildren(...shown.map((k) => element("figure", {}, block("frame", canvases.get(k)), caption(k))));
  } else {
    const frame = block("frame", canvases.get(shown[1]), canvases.get(shown[0]));
    if (mode === "wipe") frame.append(divider);
    else frame.append(element("canvas", { class: "difference", role: "img" }));
    stack.replaceChildren(
      element(
        "figure",
        {},
        frame,
        block("captions", ...shown.map(caption)),
        mode === "difference" ? element("p", { class: "scale" }) : null,
      ),
    );
  }
}

function makeCanvas(k) {
  const canvas = element("canvas", { role: "img" });
  const at = (x, y, event) => {
    if (canvas.hasPointerCapture(event.pointerId)) goAround(event.movementX, event.movementY);
    point(k, x, y);
  };
  onPointer(canvas, at, () => tell(cards.picture, []));
  if (session.exported) return canvas;
  canvas.tabIndex = 0;
  canvas.onpointerdown = (event) => canvas.setPointerCapture(event.pointerId);
  canvas.ondblclick = () => change({ yaw: 0, pitch: 0 });
  onArrows(canvas, (right, up) => goAround(10 * right, -10 * up));
  return canvas;
}

/** Let the camera go around, so that what is shown follows the hand, half a degree a pixel. */
function goAround(right, down) {
  const { yaw, pitch } = session.state;
  change({ yaw: wrapped(yaw - right / 2), pitch: pitch + down / 2 });
}

function point(k, x, y) {
  const shown = modeOf() === "side" ? [k] : pairOf();
  tell(
    cards.picture,
    shown.flatMap((each) => {
      const answer = session.shown.picture[each];
      if (!answer) return [];
      const at =
        4 *
        (Math.floor(clamp(y, 0, 0.999) * answer.height) * answer.width + Math.floor(clamp(x, 0, 0.999) * answer.width));
      const scale = 2 ** -session.state.exposure;
      const values = [0, 1, 2].map(
        (c) =>
          (answer.pixels[at + c] === 255 ? "≥ " : "") + format(fromDisplay(answer.pixels[at + c] / 255) * scale, 2),
      );
      return [[colourOf(each), `radiance ${values.join(", ")}`]];
    }),
  );
}

function put(canvas, answer) {
  canvas.answer = answer;
  canvas.classList.toggle("rough", answer.spp < 2);
  if (canvas.width !== answer.width || canvas.height !== answer.height)
    Object.assign(canvas, { width: answer.width, height: answer.height });
  stack.style.setProperty("--aspect", answer.width / answer.height);
  canvas.getContext("2d").putImageData(new ImageData(answer.pixels, answer.width, answer.height), 0, 0);
}

/** Show |a - b| of the values shown, times the power of two at which all but a fiftieth of it is below white. */
function drawDifference([a, b]) {
  const canvas = stack.querySelector("canvas.difference");
  const [first, second] = [session.shown.picture[a], session.shown.picture[b]];
  const told = stack.querySelector(".scale");
  if (!first || !second || first.width !== second.width || first.height !== second.height) {
    if (!canvas.first) told.textContent = "Waiting for both pictures …";
    return;
  }
  if (canvas.first === first && canvas.second === second) return;
  Object.assign(canvas, { first, second });
  const count = first.width * first.height;
  const histogram = new Uint32Array(256);
  let total = 0;
  const image = new ImageData(first.width, first.height);
  for (let k = 0; k < 4 * count; k++) {
    if (k % 4 === 3) continue;
    const off = Math.abs(first.pixels[k] - second.pixels[k]);
    image.data[k] = off;
    histogram[off]++;
    total += off;
  }
  let [high, above] = [255, 0];
  while (high > 0 && (above += histogram[high]) < 0.06 * count) high--;
  const gain = Math.min(2 ** Math.floor(Math.log2(255 / Math.max(high, 1))), 64);
  for (let k = 0; k < 4 * count; k++) image.data[k] = k % 4 === 3 ? 255 : image.data[k] * gain;
  Object.assign(canvas, { width: first.width, height: first.height });
  canvas.getContext("2d").putImageData(image, 0, 0);
  told.textContent =
    `|a − b| of the values shown (sRGB, 0…1), ${gain === 1 ? "as it is" : `${gain} times`}: white is ` +
    `${format(1 / gain)} and more; mean ${format(total / count / 3 / 255, 2)}`;
  canvas.setAttribute("aria-label", told.textContent);
}

/** Return the pictures as they are shown, on one canvas, or null if all are hidden. */
export function pictureImage() {
  const frames = [...stack.querySelectorAll(".frame")];
  if (!frames.length) return null;
  const { width, height } = [...stack.querySelectorAll("canvas")].sort((a, b) => b.width - a.width)[0];
  const result = element("canvas", { width: width * frames.length, height });
  const context = result.getContext("2d");
  frames.forEach((frame, at) => {
    const layers = [...frame.querySelectorAll("canvas")];
    const difference = frame.querySelector("canvas.difference");
    for (const layer of difference ? [difference] : layers) {
      const share = modeOf() === "wipe" && layer === layers[1] ? session.state.wipe : 1;
      context.drawImage(layer, 0, 0, share * layer.width, layer.height, at * width, 0, share * width, height);
    }
  });
  return result;
}
