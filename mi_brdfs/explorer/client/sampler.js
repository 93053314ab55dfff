// The sampler's view: directions drawn, a histogram of weights, the efficiency over the angle.
import { DASHES, clamp, degrees, element, format, interpolate, radians, shape, subscripted, ticks, valueScale } from "./util.js";
import { session, visible } from "./session.js";
import { cards, tell } from "./card.js";
import { attach, axes, colourOf, drawing, label, line, path, stroke, summary, widthOf } from "./drawing.js";

/** Draw the directions, weights and efficiencies of the samplers, with a box of tests above. */
export function drawSampler(chi2) {
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
    titled("Efficiency η over θi", drawEfficiency(found, width, height)),
  ];
  card.figure.replaceChildren(chi2, ...figures);
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
  const at = x - (radius * session.state.theta) / 90;
  svg.append(shape("circle", { cx: at, cy: y, r: 4, class: "source" }), label(at, y - 12, "ωi", "middle", "direction"));
  svg.addEventListener("pointermove", (event) => {
    const box = svg.getBoundingClientRect();
    const scale = width / box.width;
    const place = [(event.clientX - box.left) * scale - x, (event.clientY - box.top) * scale - y];
    const theta = (90 * Math.hypot(...place)) / radius;
    if (theta > 90) return tell(cards.sampler, []);
    const azimuth = ((degrees(Math.atan2(place[1], -place[0])) + session.state.phi + 540) % 360) - 180;
    tell(cards.sampler, [[null, `θo ${format(theta)}°, φ ${format(azimuth)}°`]]);
  });
  svg.addEventListener("pointerleave", () => tell(cards.sampler, []));
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
    cards.sampler,
    it.svg,
    (x) => it.at(x),
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

function drawEfficiency(found, width, height) {
  const scale = { of: (value) => value / 1.04, marks: [0, 0.25, 0.5, 0.75, 1].map((value) => [value, format(value)]) };
  const it = axes(
    width,
    height,
    { low: 0, high: 90, marks: [0, 30, 60, 90] },
    scale,
    summary(
      found.map(([k, { eta }]) => ({ name: session.state.subjects[k].name, ...eta })),
      "Efficiency of the samplers, 1 is perfect",
      "",
    ),
  );
  it.svg.append(line(it.x(session.state.theta), it.top, it.x(session.state.theta), it.bottom, "incident"));
  for (const [k, { eta }] of found) {
    const curve = { colour: colourOf(k), dash: DASHES[session.state.subjects[k].colour] };
    it.svg.append(
      stroke(
        curve,
        eta.x.map((angle, at) => [it.x(angle), it.y(eta.y[at])]),
      ),
    );
  }
  const overlay = shape("g");
  it.svg.append(overlay);
  attach(
    cards.sampler,
    it.svg,
    (x) => it.at(x),
    [0, 90],
    (angle) => {
      overlay.replaceChildren();
      if (angle === null) return tell(cards.sampler, []);
      overlay.append(line(it.x(angle), it.top, it.x(angle), it.bottom, "cross"));
      tell(cards.sampler, [
        [null, `θi ${format(angle)}°`],
        ...found.map(([k, { eta }]) => [
          colourOf(k),
          `${session.state.subjects[k].name} η ${format(interpolate(eta.x, eta.y, angle))}`,
        ]),
      ]);
    },
  );
  return it.svg;
}
