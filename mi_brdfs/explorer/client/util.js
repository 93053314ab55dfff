// Elements, numbers, scales and colour maps.

/** Colours of the materials on light and on dark ground, Okabe and Ito's for the colour-blind, on dark ground with those
 * of reports in front; and dashes for curves that coincide. */
export const PALETTE = [
  ["#0072B2", "#56B4E9"],
  ["#D55E00", "#F0A05A"],
  ["#009E73", "#3FCF9F"],
  ["#CC79A7", "#CC79A7"],
  ["#3A9BD4", "#F0E442"],
  ["#B97F00", "#D55E00"],
];
export const DASHES = ["", "7 3", "2 2.5", "9 3 2 3", "12 3", "5 2 1 2 1 2"];
export const CHANNELS = { red: "#d1495b", green: "#2f9e6d", blue: "#3f7fd6" };

/** Return an HTML element; `on…` attributes are listeners, true and false set and omit an attribute. */
export function element(tag, attributes = {}, ...children) {
  return fill(document.createElement(tag), attributes, children);
}

/** Return a `div` of a class. */
export const block = (name, ...children) => element("div", { class: name }, ...children);

/** Return an SVG element. */
export function shape(tag, attributes = {}, ...children) {
  return fill(document.createElementNS("http://www.w3.org/2000/svg", tag), attributes, children);
}

function fill(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value === true) node.setAttribute(name, "");
    else if (value !== false && value != null) node.setAttribute(name, value);
  }
  node.append(...children.filter((child) => child != null));
  return node;
}

/** Return a text as what to append, in which the index of θi and the like is a `tag`. */
export function subscripted(text, tag = (index) => element("sub", {}, index)) {
  return text.split(/(?<=[θφωρ])([iohds])(?!\p{L})/u).map((part, k) => (k % 2 ? tag(part) : part));
}

export const byId = (id) => document.getElementById(id);
/** Whether the window is that of a phone, as the style sheet asks, too. */
export const phone = matchMedia("(max-width: 700px)");
export const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
export const radians = (degrees) => (degrees * Math.PI) / 180;
export const degrees = (angle) => (angle * 180) / Math.PI;
/** Return an azimuth in -180°…180°. */
export const wrapped = (azimuth) => ((azimuth + 540) % 360) - 180;

/** Tell where the pointer is in a node, in 0…1 to the right and down, and when it leaves. */
export function onPointer(node, at, away) {
  const follow = (event) => {
    const box = node.getBoundingClientRect();
    at((event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height, event);
  };
  for (const event of ["pointermove", "pointerdown"]) node.addEventListener(event, follow);
  for (const event of ["pointerleave", "blur"]) node.addEventListener(event, away);
}

/** Tell of the steps of arrow keys, to the right and up. */
export function onArrows(node, move) {
  node.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (!step) return;
    event.preventDefault();
    move(...step, event);
  });
}

/** Return a number in a few letters, with a power of ten where it is very large or small. */
export function format(value, digits = 3) {
  if (value == null || Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-3) {
    const [mantissa, exponent] = value.toExponential(digits - 1).split("e");
    return (Number(mantissa) === 1 ? "" : `${Number(mantissa)}·`).replace("-", "−") + power(Number(exponent));
  }
  return String(Number(value.toPrecision(digits))).replace("-", "−");
}

/** Return 10ⁿ. */
export function power(exponent) {
  if (exponent === 0) return "1";
  return "10" + [...String(exponent)].map((sign) => (sign === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[sign])).join("");
}

/** Return the largest finite value of some arrays, or 1 if none is above 0. */
export function largest(arrays) {
  let found = 0;
  for (const values of arrays) for (const value of values) if (value > found && value < Infinity) found = value;
  return found || 1;
}

/** Return a quantile of the positive values of an array, or undefined if none is above 0. */
export function quantile(values, share) {
  const positive = Float64Array.from(values)
    .filter((value) => value > 0 && value < Infinity)
    .sort();
  return positive[Math.floor(share * positive.length)];
}

/** Return the exponents at which a logarithmic scale begins and ends: it shows nine tenths of the positive values of
 * each array, but at least two decades and at most five. */
export function decades(arrays, peak) {
  const high = Math.log10(peak);
  const dim = Math.min(peak, ...arrays.map((values) => quantile(values, 0.1) ?? peak));
  return [Math.floor(clamp(Math.log10(dim), high - 5, high - 2)), high];
}

/** Return round numbers between two limits, about `count` of them. */
export function ticks(low, high, count = 5) {
  const rough = (high - low) / count || 1;
  const unit = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((factor) => factor * unit >= rough * 0.999) * unit;
  const found = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
  return found;
}

/** Return the scale of values for a figure: `of` maps a value to 0…1, and `marks` are its labelled values. */
export function valueScale(arrays, log, least = 0) {
  const peak = Math.max(largest(arrays), least);
  if (!log) {
    const marks = ticks(0, 1.04 * peak, 4);
    return { of: (value) => value / (1.04 * peak), marks: marks.map((value) => [value, format(value)]) };
  }
  const [low, high] = decades(arrays, peak);
  const reach = high - low + 0.08;
  const marks = [];
  for (let k = low; k <= high; k++) marks.push([10 ** k, power(k)]);
  return { of: (value) => Math.max((Math.log10(Math.max(value, 1e-300)) - low) / reach, -0.1), marks };
}

/** Return the value of a curve at x, straight between its points, or null outside it. */
export function interpolate(x, y, at) {
  let low = 0;
  let high = x.length - 1;
  if (high < 0 || at < x[0] || at > x[high]) return null;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (x[middle] <= at) low = middle;
    else high = middle;
  }
  const width = x[high] - x[low];
  return width > 0 ? y[low] + ((y[high] - y[low]) * (at - x[low])) / width : y[low];
}

// Viridis (van der Walt and Smith, CC0) at every sixteenth of its range.
const VIRIDIS = (
  "440154 481a6c 472f7d 414487 39568c 31688e 2a788e 23888e 1f988b 22a884 35b779 54c568 7ad151 a5db36 " +
  "d2e21b ece51b fde725"
)
  .split(" ")
  .map((word) => [0, 2, 4].map((k) => parseInt(word.slice(k, k + 2), 16)));

/** Return 256 colours of the map, four bytes each. */
export const COLOUR_MAP = (() => {
  const table = new Uint8ClampedArray(4 * 256);
  for (let k = 0; k < 256; k++) {
    const at = (k / 255) * (VIRIDIS.length - 1);
    const low = Math.min(Math.floor(at), VIRIDIS.length - 2);
    for (let c = 0; c < 3; c++)
      table[4 * k + c] = VIRIDIS[low][c] + (at - low) * (VIRIDIS[low + 1][c] - VIRIDIS[low][c]);
    table[4 * k + 3] = 255;
  }
  return table;
})();

/** Return the channels of a colour such as #0072B2, in 0…1. */
export const rgbOf = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16) / 255);
export const toDisplay = (v) => (v <= 0.0031308 ? 12.92 * v : 1.055 * Math.pow(v, 1 / 2.4) - 0.055);
export const fromDisplay = (v) => (v <= 0.04045 ? v / 12.92 : Math.pow((v + 0.055) / 1.055, 2.4));

/** Offer data for saving. */
export function save(name, data, mime) {
  const url = URL.createObjectURL(data instanceof Blob ? data : new Blob([data], { type: mime }));
  element("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10000);
}

/** Return a figure as a file of its own, with the colours that it has on the page. */
export function standalone(figure) {
  const copy = figure.cloneNode(true);
  const wanted = [
    "fill",
    "stroke",
    "stroke-width",
    "stroke-dasharray",
    "opacity",
    "fill-opacity",
    "font-size",
    "text-anchor",
  ];
  const originals = [figure, ...figure.querySelectorAll("*")];
  [copy, ...copy.querySelectorAll("*")].forEach((node, k) => {
    const style = getComputedStyle(originals[k]);
    for (const name of wanted) node.setAttribute(name, style.getPropertyValue(name));
    node.removeAttribute("class");
  });
  copy.setAttribute("xmlns", "http://www.w3.org/2000/svg");
  copy.setAttribute("font-family", "system-ui, sans-serif");
  copy.removeAttribute("tabindex");
  const paper = getComputedStyle(figure.closest(".card")).backgroundColor;
  copy.prepend(shape("rect", { width: "100%", height: "100%", fill: paper }));
  return new XMLSerializer().serializeToString(copy);
}
