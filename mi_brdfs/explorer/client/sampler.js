// The sampler's view: directions drawn, a histogram of weights, the efficiency over the angle.
import { block, clamp, degrees, element, format, onPointer, radians, shape, subscripted, ticks, valueScale, wrapped } from "./util.js";
import { emit, on, session, visible } from "./session.js";
import { post } from "./link.js";
import { cards, tell } from "./card.js";
import { attach, axes, colourOf, drawing, label, line, path, plot, summary, widthOf } from "./drawing.js";
import { curvesOf } from "./plots.js";

/** What the χ² tests said of the subjects. */
const verdicts = [];

export function startSampler() {
  on("stale", () => (verdicts.length = 0));
  on("chi2", ({ subject, passed, text }) => {
    verdicts[subject] = `${passed === undefined ? "" : passed ? "passed: " : "failed: "}${text}`;
    emit("view", "sampler");
  });
}

function verdictOf(k) {
  const test = () => {
    verdicts[k] = "testing …";
    post({ type: "chi2", subject: k });
    drawSampler();
  };
  const button = session.exported ? null : element("button", { onclick: test }, "χ² test");
  const { efficiency } = session.shown.sampler[k] ?? {};
  const told = [session.state.subjects[k].name];
  if (efficiency !== undefined) told.push(`efficiency η ${format(efficiency)}`);
  if (verdicts[k]) told.push(verdicts[k]);
  return element("p", { class: "marked", style: `--mark:${colourOf(k)}` }, button, ` ${told.join(": ")}`);
}

/** Draw the directions, weights and efficiencies of the samplers, with their tests above. */
export function drawSampler() {
  const card = cards.sampler;
  const found = visible()
    .filter((k) => session.shown.sampler[k])
    .map((k) => [k, session.shown.sampler[k]]);
  const full = widthOf(card, 1400);
  const columns = full > 700 ? 3 : 1;
  const width = Math.floor((full - 16 * (columns - 1)) / columns);
  const height = Math.round(clamp(0.7 * width, 190, 300));
  const titled = (title, svg) => element("figure", {}, element("figcaption", {}, ...subscripted(title)), svg);
  const figures = [
    titled("Directions drawn", drawDots(found, width, Math.max(height, Math.min(width, 300)))),
    titled("Weight ÷ mean weight", drawHistogram(found, width, height)),
    titled("Efficiency η over θi", drawEfficiency(width, height)),
  ];
  card.figure.replaceChildren(block("verdicts", ...visible().map(verdictOf)), ...figures);
}

function drawDots(found, width, height) {
  const svg = drawing(
    width,
    height,
    `Directions drawn by the samplers of ${found.length} materials, seen from above, ωi on the left`,
  );
  const radius = height / 2 - 14;
  const [x, y] = [width / 2, height / 2];
  for (const angle of [30, 60, 90]) {
    svg.append(shape("circle", { cx: x, cy: y, r: (radius * angle) / 90, class: angle === 90 ? "rim" : "grid" }));
    svg.append(label(x, y - (radius * angle) / 90 + 11, `${angle}°`));
  }
  const [cos, sin] = [Math.cos(radians(session.state.phi)), Math.sin(radians(session.state.phi))];
  for (const [k, { dots: drawn }] of found) {
    const group = shape("g", { fill: colourOf(k), class: "drawn" });
    for (const [wx, wy, wz] of drawn) {
      const [along, across] = [cos * wx + sin * wy, cos * wy - sin * wx];
      const length = Math.hypot(along, across) || 1;
      const reach = (radius * degrees(Math.atan2(length, Math.abs(wz)))) / 90 / length;
      const place = { cx: (x - along * reach).toFixed(1), cy: (y + across * reach).toFixed(1), r: 1.4 };
      group.append(shape("circle", wz < 0 ? { ...place, class: "below", stroke: colourOf(k) } : place));
    }
    svg.append(group);
  }
  const left = x - (radius * session.state.theta) / 90;
  svg.append(shape("circle", { cx: left, cy: y, r: 4, class: "source" }), label(left, y - 12, "ωi", "middle", "direction"));
  const away = () => tell(cards.sampler, []);
  const at = (right, down) => {
    const place = [right * width - x, down * height - y];
    const theta = (90 * Math.hypot(...place)) / radius;
    if (theta > 90) return away();
    const azimuth = wrapped(degrees(Math.atan2(place[1], -place[0])) + session.state.phi);
    tell(cards.sampler, [[null, `θo ${format(theta)}°, φ ${format(azimuth)}°`]]);
  };
  onPointer(svg, at, away);
  return svg;
}

function drawHistogram(found, width, height) {
  const shares = found.map(([k, { histogram }]) => {
    const total = histogram.count.reduce((sum, count) => sum + count, 0) || 1;
    return [k, histogram.edges, histogram.count.map((count) => count / total)];
  });
  const high = Math.max(2, ...shares.map(([, edges]) => edges[edges.length - 1]));
  const scale = valueScale(
    shares.map(([, , share]) => share),
    false,
  );
  const it = axes(
    width,
    height,
    { low: 0, high, marks: ticks(0, high, 5) },
    scale,
    "Histogram of the weight over its mean: a narrow one is good",
    "",
  );
  it.svg.append(line(it.x(1), it.top, it.x(1), it.bottom, "unity"));
  for (const [k, edges, share] of shares) {
    const points = share.flatMap((value, bin) => [
      [it.x(edges[bin]), it.y(value)],
      [it.x(edges[bin + 1]), it.y(value)],
    ]);
    const closed = [[it.x(edges[0]), it.bottom], ...points, [it.x(edges[edges.length - 1]), it.bottom]];
    it.svg.append(shape("path", { d: path(closed), fill: colourOf(k), class: "area", stroke: colourOf(k) }));
  }
  attach(
    it.svg,
    it.at,
    [0, high],
    (weight) => {
      if (weight === null) return tell(cards.sampler, []);
      const shareAt = (edges, share) => share[edges.findLastIndex((edge) => edge <= weight)] ?? 0;
      const told = shares.map(([k, edges, share]) => [
        colourOf(k),
        `${session.state.subjects[k].name} ${format(100 * shareAt(edges, share))}\u00a0%`,
      ]);
      tell(cards.sampler, [[null, `weight ${format(weight)} of the mean`], ...told]);
    },
  );
  return it.svg;
}

function drawEfficiency(width, height) {
  const scale = { of: (value) => value / 1.04, marks: [0, 0.25, 0.5, 0.75, 1].map((value) => [value, format(value)]) };
  const curves = curvesOf("sampler");
  const { svg } = plot(
    cards.sampler,
    [width, height],
    curves,
    { low: 0, high: 90, marks: [0, 30, 60, 90] },
    scale,
    summary(curves, "Efficiency of the samplers, 1 is perfect"),
    "θi",
    ({ svg, x, top, bottom }) => svg.append(line(x(session.state.theta), top, x(session.state.theta), bottom, "incident")),
  );
  return svg;
}
