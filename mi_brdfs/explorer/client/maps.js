// Maps in false colours: the θh × θd slice and the hemisphere.
import { COLOUR_MAP, block, clamp, decades, degrees, element, format, largest, onArrows, onPointer, power, quantile, shape, subscripted, wrapped } from "./util.js";
import { session, visible } from "./session.js";
import { cards, tell } from "./card.js";
import { quantity } from "./plots.js";

/** Draw the maps of a view beside each other, on one logarithmic scale of colours. */
export function drawMaps(view) {
  const card = cards[view];
  const found = visible().flatMap((subject) =>
    (session.shown[view][subject]?.parts ?? []).map((part, at) => ({ ...part, subject, below: at > 0 })),
  );
  const arrays = found.map(({ values }) => values);
  // At grazing incidence a sliver of the slice may be brighter than all else by decades.
  const bright = view === "slice" ? arrays.map((values) => quantile(values, 0.99) ?? 0) : [];
  const peak = Math.max(...bright, 0) || largest(arrays);
  const [low, high] = decades(arrays, peak);
  card.maps ??= card.figure.appendChild(block("maps"));
  card.node.classList.toggle("wide", found.length > 1);
  card.maps.className = `maps of-${Math.min(found.length, 4)}`;
  const boxes = [...card.maps.children];
  found.forEach((map, k) => paint(boxes[k] ?? addBox(card, view), view, map, low, high));
  boxes.slice(found.length).forEach((box) => box.remove());
  if (view === "hemisphere") card.note.replaceChildren(...subscripted(`${quantity()} from above`));
  const hatched = [view === "slice" && "below the horizon", found.some(isMeasured) && "not measured"].filter(Boolean);
  const notes = [
    `${view === "slice" ? "f" : quantity()}, 1/sr, always logarithmic`,
    ...(hatched.length ? [`hatched: ${hatched.join(" or ")}`] : []),
    ...(largest(arrays) > peak ? [`yellow: ${format(peak, 2)} and above`] : []),
    ...(view === "slice" ? [] : ["○ ωi, + mirror, rim 90°"]),
  ];
  bar(card, low, high, notes.join("; "));
}

function addBox(card, view) {
  const canvas = element("canvas", { role: "img", tabindex: 0 });
  const marks = shape("svg", { class: "marks", viewBox: "-1 -1 2 2", "aria-hidden": "true" });
  const frame = block("plate", canvas, marks, element("i", { class: "spot", hidden: true }));
  const ticks = (symbol, side) =>
    [[0, "0°"], [30, "30°"], [45, symbol], [60, "60°"], [90, "90°"]].map(([at, text]) =>
      element("span", { style: `${side}:${at / 0.9}%` }, ...subscripted(text)),
    );
  const axes = view === "slice" ? [block("labels", ...ticks("θh", "left"))] : [];
  if (view === "slice") frame.append(block("up", ...ticks("θd", "bottom")));
  const box = element("figure", { class: "map" }, element("figcaption"), frame, ...axes);
  card.maps.append(box);
  let spot = [0.5, 0.5];
  const show = (x, y) => {
    spot = [clamp(x, 0, 0.9999), clamp(y, 0, 0.9999)];
    const mark = frame.querySelector(".spot");
    mark.hidden = false;
    mark.style.left = `${100 * spot[0]}%`;
    mark.style.top = `${100 * spot[1]}%`;
    tell(card, [[null, where(view, box.map, spot[0], 1 - spot[1])]]);
  };
  const hide = () => {
    frame.querySelector(".spot").hidden = true;
    tell(card, []);
  };
  onPointer(canvas, show, hide);
  onArrows(canvas, (right, up) => show(spot[0] + right / 45, spot[1] - up / 45));
  return box;
}

/** Return in words what is at a place, x to the right and y upwards in 0…1. */
function where(view, map, x, y) {
  const value = map.values[Math.floor(y * map.height) * map.width + Math.floor(x * map.width)];
  const name = session.state.subjects[map.subject]?.name;
  if (view === "slice") {
    return `${name}: θh ${format(90 * x)}°, θd ${format(90 * y)}°: ${told(map, "f", value)}`;
  }
  const [along, across] = [2 * x - 1, 2 * y - 1];
  const theta = 90 * Math.hypot(along, across);
  if (theta > 90) return `${name}: outside the hemisphere`;
  const azimuth = wrapped(degrees(Math.atan2(-across, -along)) + session.state.phi);
  return `${name}: θo ${format(map.below ? 180 - theta : theta)}°, φ ${format(azimuth)}°: ${told(map, quantity(), value)}`;
}

const isMeasured = ({ subject }) => session.state.subjects[subject]?.bsdf.type === "tabulated";

const told = (map, name, value) =>
  Number.isNaN(value) ? (isMeasured(map) ? "not measured" : "at the horizon") : `${name} ${format(value, 4)}`;

function paint(box, view, map, low, high) {
  box.map = map;
  const { width, height, values } = map;
  const canvas = box.querySelector("canvas");
  const name = session.state.subjects[map.subject].name + (map.below ? ", below" : "");
  box.querySelector("figcaption").textContent = name;
  box.classList.toggle("dimmed", Boolean(session.info[map.subject]?.error));
  canvas.setAttribute(
    "aria-label",
    `${view === "slice" ? "Slice over θh and θd" : "Hemisphere"} of ${name}: at most ${format(largest([values]))}`,
  );
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  const image = new ImageData(width, height);
  for (let row = 0; row < height; row++) {
    for (let column = 0; column < width; column++) {
      const value = values[(height - 1 - row) * width + column];
      const outside =
        view === "hemisphere" && Math.hypot((2 * (column + 0.5)) / width - 1, (2 * (row + 0.5)) / height - 1) > 1;
      if (outside) continue;
      if (Number.isNaN(value)) {
        if (isMeasured(map) && (row + column) % 6 === 0) image.data.fill(128, 4 * (row * width + column), 4 * (row * width + column) + 4);
        continue;
      }
      const share = value > 0 ? (Math.log10(value) - low) / (high - low) : 0;
      const colour = 4 * Math.round(255 * clamp(share, 0, 1));
      image.data.set(COLOUR_MAP.subarray(colour, colour + 4), 4 * (row * width + column));
    }
  }
  canvas.getContext("2d").putImageData(image, 0, 0);
  const marks = box.querySelector(".marks");
  marks.classList.toggle("measured", isMeasured(map));
  if (view === "hemisphere") marks.replaceChildren(...ringsOf(map));
}

/** Draw the rings of a hemisphere, and wi and its mirror direction on the side of the light. */
function ringsOf(map) {
  const x = session.state.theta / 90;
  const rings = [30, 60].flatMap((angle) => [
    shape("circle", { r: angle / 90, class: "ring" }),
    shape("text", { y: angle / 90 + 0.04, "text-anchor": "middle" }, `${angle}°`),
  ]);
  if (map.below) return rings;
  return [...rings, shape("circle", { cx: -x, r: 0.045 }), shape("path", { d: `M${x - 0.055} 0h.11M${x} -.055v.11` })];
}

function bar(card, low, high, unit) {
  const box = card.figure.querySelector(".bar") ?? card.figure.appendChild(block("bar"));
  const stops = Array.from(
    { length: 17 },
    (_, k) => `rgb(${[...COLOUR_MAP.subarray(4 * Math.round(k * 15.9375), 4 * Math.round(k * 15.9375) + 3)]})`,
  );
  const labels = [];
  for (let k = low; k <= high; k++)
    labels.push(element("span", { style: `left:${(100 * (k - low)) / (high - low)}%` }, power(k)));
  box.replaceChildren(
    element("div", { class: "ramp", style: `background:linear-gradient(90deg,${stops})` }),
    block("labels", ...labels),
    block("unit", ...subscripted(unit)),
  );
}

/** Return the maps of a view on one canvas, four times as large, with their names. */
export function mapsImage(view) {
  const boxes = [...cards[view].maps.children];
  const canvases = boxes.map((box) => box.querySelector("canvas"));
  const size = 4 * Math.max(...canvases.map(({ width }) => width));
  const result = element("canvas", { width: boxes.length * (size + 16), height: size + 32 });
  const context = result.getContext("2d");
  const style = getComputedStyle(cards[view].node);
  context.fillStyle = style.backgroundColor;
  context.fillRect(0, 0, result.width, result.height);
  Object.assign(context, { imageSmoothingEnabled: false, font: "18px system-ui, sans-serif", fillStyle: style.color });
  canvases.forEach((canvas, k) => {
    context.fillText(boxes[k].querySelector("figcaption").textContent, k * (size + 16), 20);
    context.drawImage(canvas, k * (size + 16), 32, size, size);
  });
  return result;
}
