// What plots are drawn with: paths, labels, axes, and a crosshair that pointer and keys move.
import { PALETTE, clamp, format, largest, shape, subscripted } from "./util.js";
import { session } from "./session.js";

export const isDark = () => session.state.dark ?? matchMedia("(prefers-color-scheme: dark)").matches;
export const colourOf = (k) => PALETTE[session.state.subjects[k]?.colour ?? k][Number(isDark())];

/** Return the path through points, without those that cannot be told from the one before; it ends where one is none. */
export function path(points) {
  let text = "";
  let last = null;
  points.forEach(([x, y], k) => {
    if (!Number.isFinite(x + y)) {
      last = null;
      return;
    }
    if (last && k < points.length - 1 && Math.abs(x - last[0]) + Math.abs(y - last[1]) < 0.25) return;
    text += `${last ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`;
    last = [x, y];
  });
  return text;
}

/** The width of a letter of labels, about. */
export const LETTER = 7;

export const line = (x1, y1, x2, y2, kind) => shape("line", { x1, y1, x2, y2, class: kind });
export const label = (x, y, text, anchor = "middle", kind = "tick") =>
  shape(
    "text",
    { x, y, "text-anchor": anchor, class: kind },
    ...subscripted(text, (index) => shape("tspan", { dy: 3, "font-size": "0.75em" }, index)),
  );
export const drawing = (width, height, summary) =>
  shape("svg", { viewBox: `0 0 ${width} ${height}`, width, height, role: "img", tabindex: 0, "aria-label": summary });

export function stroke(curve, points) {
  return shape("path", {
    d: path(points),
    class: curve.dimmed ? "curve dimmed" : "curve",
    stroke: curve.colour,
    "stroke-dasharray": curve.dash,
  });
}

export function summary(curves, what, unit) {
  const parts = curves.map(({ name, x, y }) => {
    const peak = largest([y]);
    return `${name}: at most ${format(peak)}${unit} at ${format(x[y.findIndex((value) => value === peak)] ?? 0)}°`;
  });
  return `${what}. ${parts.join("; ") || "No data yet"}.`;
}

/** A crosshair that pointer and arrow keys move: `angleAt` maps a place to an angle, `cross` draws it. */
export function attach(card, svg, angleAt, range, cross) {
  let angle = null;
  const move = (to) => {
    angle = to;
    cross(to);
  };
  const follow = (event) => {
    const box = svg.getBoundingClientRect();
    const scale = svg.viewBox.baseVal.width / box.width;
    move(angleAt((event.clientX - box.left) * scale, (event.clientY - box.top) * scale));
  };
  svg.addEventListener("pointermove", follow);
  svg.addEventListener("pointerdown", follow);
  svg.addEventListener("pointerleave", () => move(null));
  svg.addEventListener("blur", () => move(null));
  svg.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1, ArrowDown: -10, ArrowUp: 10 }[event.key];
    if (!step) return;
    event.preventDefault();
    move(clamp((angle ?? session.state.theta) + step * (event.shiftKey ? 0.1 : 1), ...range));
  });
}

export const widthOf = (card, most) => Math.max(Math.min(card.figure.clientWidth, most), 240);

let drawings = 0;

/** Draw axes; return the drawing and where values are in it. */
export function axes(width, height, across, scale, what, unit = "°") {
  const [left, right, top, bottom] = [46, 14, 14, 26];
  const svg = drawing(width, height, what);
  const clip = `inside-${++drawings}`;
  svg.append(
    shape(
      "clipPath",
      { id: clip },
      shape("rect", { x: left, y: top - 4, width: width - left - right, height: height - top - bottom + 6 }),
    ),
  );
  const x = (value) => left + ((value - across.low) / (across.high - across.low)) * (width - left - right);
  const y = (value) => height - bottom - clamp(scale.of(value), -0.1, 9) * (height - top - bottom);
  for (const [value, text] of scale.marks) {
    svg.append(line(left, y(value), width - right, y(value), "grid"), label(left - 6, y(value) + 4, text, "end"));
  }
  const texts = across.marks.map((value) => `${format(value)}${unit}`);
  const apart = (x(across.high) - x(across.low)) / (texts.length - 1);
  // As many labels as there is room for, counted from 0.
  const step = Math.ceil((LETTER * Math.max(...texts.map(({ length }) => length + 1))) / apart);
  const zero = Math.max(across.marks.indexOf(0), 0);
  across.marks.forEach((value, k) => {
    svg.append(line(x(value), top, x(value), height - bottom, "grid"));
    if ((k - zero) % step === 0) svg.append(label(x(value), height - bottom + 17, texts[k]));
  });
  svg.append(line(left, height - bottom, width - right, height - bottom, "axis"));
  const at = (place) =>
    clamp(across.low + ((place - left) / (width - left - right)) * (across.high - across.low), across.low, across.high);
  return { svg, x, y, at, clip, top, bottom: height - bottom };
}
