// What plots are drawn with: paths, labels, axes, and a crosshair that pointer and keys move.
import { PALETTE, clamp, format, interpolate, largest, onArrows, onPointer, shape, subscripted } from "./util.js";
import { session } from "./session.js";
import { tell } from "./card.js";

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

export function summary(curves, what) {
  const parts = curves.map(({ name, x, y }) => {
    const peak = largest([y]);
    return `${name}: at most ${format(peak)} at ${format(x[y.findIndex((value) => value === peak)] ?? 0)}°`;
  });
  return `${what}. ${parts.join("; ") || "No data yet"}.`;
}

/** A crosshair that pointer and arrow keys move: `angleAt` maps a place to an angle, `cross` draws it. */
export function attach(svg, angleAt, range, cross) {
  let angle = null;
  const move = (to) => {
    angle = to;
    cross(to);
  };
  const { width, height } = svg.viewBox.baseVal;
  onPointer(
    svg,
    (x, y) => move(angleAt(x * width, y * height)),
    () => move(null),
  );
  onArrows(svg, (right, up, { shiftKey }) =>
    move(clamp((angle ?? session.state.theta) + (right + 10 * up) * (shiftKey ? 0.1 : 1), ...range)),
  );
}

/** Return the width for drawings in a card: rounded down, so that several fit beside each other. */
export const widthOf = (card, most) => Math.max(Math.min(Math.floor(card.figure.getBoundingClientRect().width), most), 240);

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

/** Draw curves over an angle, after what `mark` draws; return the drawing, and what moves its crosshair: to an angle, or
 * with null away. `pointed` is told where the pointer is. */
export function plot(card, [width, height], curves, across, scale, what, symbol, mark, pointed = null) {
  const it = axes(width, height, across, scale, what);
  mark(it);
  const inside = shape("g", { "clip-path": `url(#${it.clip})` });
  for (const curve of curves)
    inside.append(
      stroke(
        curve,
        curve.x.map((angle, k) => [it.x(angle), it.y(curve.y[k])]),
      ),
    );
  const overlay = shape("g");
  it.svg.append(inside, overlay);
  const cross = (angle) => {
    overlay.replaceChildren();
    if (angle === null) return tell(card, []);
    overlay.append(line(it.x(angle), it.top, it.x(angle), it.bottom, "cross"));
    dots(overlay, curves, angle, (value) => [it.x(angle), it.y(value)]);
    tell(card, [[null, `${symbol} ${format(angle)}°`], ...valuesAt(curves, angle)]);
  };
  attach(it.svg, it.at, [across.low, across.high], pointed ?? cross);
  return { svg: it.svg, cross };
}

/** Mark the values of curves at an angle. */
export function dots(overlay, curves, angle, place) {
  for (const curve of curves) {
    const value = interpolate(curve.x, curve.y, angle);
    if (!Number.isFinite(value)) continue;
    const [cx, cy] = place(value);
    overlay.append(shape("circle", { cx, cy, r: 4, fill: curve.colour, class: "dot" }));
  }
}

export const valuesAt = (curves, angle) =>
  curves.map(({ colour, name, x, y, dash }) => [colour, `${name} ${format(interpolate(x, y, angle), 4)}`, dash]);
