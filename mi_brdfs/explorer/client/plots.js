// Curves: the plane of incidence as polar and cartesian plots; and albedo.
import { CHANNELS, DASHES, clamp, degrees, format, largest, phone, radians, shape, subscripted, valueScale } from "./util.js";
import { session, visible } from "./session.js";
import { cards, tell } from "./card.js";
import { LETTER, attach, colourOf, dots, drawing, label, line, path, plot, stroke, summary, valuesAt, widthOf } from "./drawing.js";

/** Return the curves of a view: those of the subjects to be seen, or of one channel each. */
export function curvesOf(view) {
  return visible().flatMap((k) =>
    (session.shown[view][k]?.curves ?? []).map((curve) => ({
      ...curve,
      y: curve.y.map((value) => value ?? NaN),
      subject: k,
      dimmed: Boolean(session.info[k]?.error),
      dash: DASHES[session.state.subjects[k].colour],
      colour: CHANNELS[curve.channel] ?? colourOf(k),
      name: session.state.subjects[k].name + (CHANNELS[curve.channel] ? `, ${curve.channel}` : ""),
    })),
  );
}

/** Return curves of f cosθ, each over its subject's maximum if they are to be normalised. */
function lobesOf(view) {
  const curves = curvesOf(view);
  if (!session.state.normalise) return curves;
  const peak = {};
  for (const curve of curves) peak[curve.subject] = Math.max(peak[curve.subject] ?? 0, largest([curve.y]));
  return curves.map((curve) => ({ ...curve, y: curve.y.map((value) => value / peak[curve.subject]) }));
}

/** Where the plane of incidence is looked at, in both of its plots. */
let cursor = null;
const crosses = {};

function pointAt(angle) {
  cursor = angle;
  for (const cross of Object.values(crosses)) cross();
}

function replaceFigure(card, ...nodes) {
  const focused = card.figure.contains(document.activeElement) && document.activeElement.tagName === "svg";
  card.figure.replaceChildren(...nodes);
  if (focused) nodes[0].focus();
}

/** Put the legend and the unit of curves of f cosθ into their card. */
function describe(card, curves, axis = AXES.theta_o) {
  card.legend = curves.map(({ colour, name, dash }) => [colour, name, dash]);
  card.note.replaceChildren(...subscripted(`${unitOf()}, ${axis.held()}`));
}

/** Return by what factor the maxima of curves differ, of those that are not black. */
function spread(curves) {
  const peaks = curves.filter(({ y }) => y.some((value) => value > 0)).map(({ y }) => largest([y]));
  return Math.max(...peaks) / Math.min(...peaks);
}

/** Return whether curves go on below the surface. */
const isWhole = (curves) => curves.some(({ x }) => x[0] < -91 || x.at(-1) > 91);

export const quantity = () => (session.state.cosine ? "f cosθo" : "f");
const unitOf = () => quantity() + (session.state.normalise ? " / maximum" : ", 1/sr");

const quarter = { low: 0, high: 90, marks: [0, 15, 30, 45, 60, 75, 90] };
const thetaI = () => `${format(session.state.theta)}°`;
/** What the cartesian plot goes along: its symbol, where that is, and what is held. */
export const AXES = {
  theta_o: { symbol: "θo", title: "Plane of incidence", held: () => `at θi = ${thetaI()}` },
  theta_h: { symbol: "θh", title: "Along θh", held: () => `at θd = θi = ${thetaI()}, φd = 90°`, ...quarter },
  theta_d: { symbol: "θd", title: "Along θd", held: () => "at θh = 0, in mirror directions", ...quarter },
  phi: {
    symbol: "φo − φi",
    title: "Around the normal",
    held: () => `at θo = θi = ${thetaI()}`,
    low: 0,
    high: 360,
    marks: [0, 60, 120, 180, 240, 300, 360],
  },
};

// --- Polar ----------------------------------------------------------------------------------------------------------

export function drawPolar() {
  const card = cards.polar;
  const curves = lobesOf("polar");
  describe(card, curves);
  const whole = isWhole(curves);
  const scale = valueScale(
    curves.map(({ y }) => y),
    session.state.scale === "log",
  );
  const width = widthOf(card, Math.min(620, (phone.matches ? 0.3 : 0.45) * innerHeight));
  const margin = 26;
  const radius = (width - 2 * margin) / 2;
  const height = whole ? 2 * (radius + margin) : radius + 2 * margin + 4;
  const middle = [width / 2, margin + radius];
  const place = (angle, reach) => [
    middle[0] + radius * Math.max(reach, 0) * Math.sin(radians(angle)),
    middle[1] - radius * Math.max(reach, 0) * Math.cos(radians(angle)),
  ];
  const svg = drawing(width, height, summary(curves, `Polar plot of ${unitOf()} in the plane of incidence`));

  const ring = (reach, kind) => {
    const [x, y] = place(-90, reach);
    const r = radius * reach;
    const around = `M${x} ${y}a${r} ${r} 0 0 1 ${2 * r} 0` + (whole ? `a${r} ${r} 0 0 1 ${-2 * r} 0` : "");
    return shape("path", { d: around, class: kind });
  };
  let taken = 0;
  for (const [value, text] of scale.marks) {
    const reach = scale.of(value);
    if (reach <= 0.02) continue;
    svg.append(ring(reach, "grid"));
    const half = (LETTER * (text.length + 1)) / 2;
    if (reach <= 0.14 || radius * reach - half < taken) continue;
    svg.append(label(middle[0] + radius * reach, middle[1] + 14, text));
    taken = radius * reach + half;
  }
  svg.append(ring(1, "rim"));
  for (let angle = whole ? -180 : -90; angle < (whole ? 180 : 91); angle += 30) {
    const [x, y] = place(angle, 1);
    const [tx, ty] = place(angle, 1 + 15 / radius);
    svg.append(line(...middle, x, y, "grid"));
    if (Math.abs(angle) !== 90) svg.append(label(tx, ty + 4, `${Math.abs(angle)}°`));
  }
  svg.append(line(middle[0] - radius, middle[1], middle[0] + radius, middle[1], "axis"));
  const { theta } = session.state;
  svg.append(shape("path", { d: path([middle, place(theta, 1)]), class: "mirror" }));
  for (const curve of curves)
    svg.append(
      stroke(
        curve,
        curve.x.map((angle, k) => place(angle, scale.of(curve.y[k]))),
      ),
    );
  svg.append(line(...middle, ...place(-theta, 1), "incident"));
  const [head, half] = [1 - 12 / radius, degrees(4 / radius)];
  const outline = path([place(half - theta, head), place(-theta, 1), place(-half - theta, head)]);
  svg.append(shape("path", { d: outline, class: "source" }));
  const aside = degrees(20 / radius);
  const [besideX, besideY] = place(-theta + (theta < 30 ? -aside : aside), 1 - 14 / radius);
  svg.append(label(besideX, besideY + 4, "ωi", "middle", "direction"));
  const overlay = shape("g");
  svg.append(overlay);

  crosses.polar = () => {
    overlay.replaceChildren();
    if (cursor === null) return tell(card, []);
    overlay.append(shape("path", { d: path([middle, place(cursor, 1)]), class: "cross" }));
    dots(overlay, curves, cursor, (value) => place(cursor, scale.of(value)));
    tell(card, [[null, `θo ${format(cursor)}°`], ...valuesAt(curves, cursor)]);
  };
  attach(
    svg,
    (x, y) => {
      const angle = degrees(Math.atan2(x - middle[0], middle[1] - y));
      return whole ? angle : clamp(angle, -89.9, 89.9);
    },
    whole ? [-180, 180] : [-89.9, 89.9],
    pointAt,
  );
  replaceFigure(card, svg);
  crosses.polar();
}

// --- Cartesian ------------------------------------------------------------------------------------------------------

const sizeOf = (card) => {
  const width = widthOf(card, 760);
  return [width, Math.round(clamp(Math.min(0.62 * width, 0.27 * innerHeight), 200, 380))];
};

export function drawCartesian() {
  const curves = lobesOf("cartesian");
  const axis = AXES[session.state.axis];
  const inPlane = axis === AXES.theta_o;
  describe(cards.cartesian, curves, axis);
  cards.cartesian.node.querySelector("h2").replaceChildren(...subscripted(axis.title));
  const across = !inPlane
    ? axis
    : isWhole(curves)
    ? { low: -180, high: 180, marks: [-180, -90, 0, 90, 180] }
    : { low: -90, high: 90, marks: [-90, -60, -30, 0, 30, 60, 90] };
  // At grazing angles, f may be without end.
  const scale = valueScale(
    curves.map(({ x, y }) => (axis.high === 90 ? y.filter((value, k) => x[k] <= 85) : y)),
    session.state.scale === "log",
  );
  const { theta } = session.state;
  const mark = ({ svg, x, top, bottom }) => {
    if (!inPlane) return;
    svg.append(
      line(x(-theta), top, x(-theta), bottom, "incident"),
      label(x(-theta) + 5, top + 10, "ωi", "start", "direction"),
    );
    svg.append(line(x(theta), top, x(theta), bottom, "mirror"));
  };
  const { svg, cross } = plot(
    cards.cartesian,
    sizeOf(cards.cartesian),
    curves,
    across,
    scale,
    summary(curves, `Plot of ${unitOf()} over ${axis.symbol}`),
    axis.symbol,
    mark,
    inPlane ? pointAt : null,
  );
  replaceFigure(cards.cartesian, svg);
  crosses.cartesian = () => cross(inPlane ? cursor : null);
  crosses.cartesian();
}

export function drawAlbedo() {
  const curves = curvesOf("albedo");
  const gained = largest(curves.map(({ y }) => y));
  const dark = gained < 0.2;
  // Where energy is gained without end, the scale is that of angles up to 85°.
  const scale = valueScale(
    curves.map(({ x, y }) => y.filter((value, k) => x[k] <= 85 || value < 1.3)),
    session.state.scale === "log" && spread(curves) > 10,
    dark ? 0 : 1.02,
  );
  cards.albedo.note.textContent = "over the angle of incidence" + (gained > 1.005 ? `, up to ${format(gained)}` : "");
  const mark = ({ svg, x, y, top, bottom }) => {
    if (!dark) svg.append(line(x(0), y(1), x(90), y(1), "unity"));
    svg.append(line(x(session.state.theta), top, x(session.state.theta), bottom, "incident"));
  };
  const { svg } = plot(
    cards.albedo,
    sizeOf(cards.albedo),
    curves,
    quarter,
    scale,
    summary(curves, `Albedo over the angle of incidence${dark ? "" : ", with a line at 1"}`),
    "θi",
    mark,
  );
  replaceFigure(cards.albedo, svg);
  cards.albedo.legend = curves.map(({ colour, name, dash }) => [colour, name, dash]);
  tell(cards.albedo, []);
}

/** Return the curves of a view as rows of a table. */
export function curveTable(view) {
  return [
    [
      "material",
      "channel",
      `${{ albedo: "theta_i", sampler: "theta_i", cartesian: session.state.axis }[view] ?? "theta_o"}_degrees`,
      { albedo: "albedo", sampler: "efficiency" }[view] ?? (session.state.cosine ? "f_cos_theta_o" : "f"),
    ],
    ...visible().flatMap((k) =>
      (session.shown[view][k]?.curves ?? []).flatMap((curve) =>
        curve.x.map((angle, at) => [session.state.subjects[k].name, curve.channel, angle, curve.y[at]]),
      ),
    ),
  ];
}
