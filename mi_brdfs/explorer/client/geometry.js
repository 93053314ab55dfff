// Directions, and the triangles and lines of what the view of the lobe shows.
import { radians } from "./util.js";

/** The length of the arrow of wi; the lobe's is 1 at most. */
export const ARROW = 1.06;

export const unit = (theta, phi) => [
  Math.sin(radians(theta)) * Math.cos(radians(phi)),
  Math.sin(radians(theta)) * Math.sin(radians(phi)),
  Math.cos(radians(theta)),
];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const scaled = (a, factor) => a.map((value) => value * factor);
export const sum = (a, b) => a.map((value, k) => value + b[k]);

/** Return the surface of a grid of values above or below the surface, with radii as `radius` maps them. */
export function makeBody({ theta, phi, values }, below, radius) {
  const [rows, columns] = [theta.length, phi.length];
  const closed = phi[columns - 1] - phi[0] > 359.9;
  const across = closed ? columns : columns + 1;
  const position = new Float32Array(rows * across * 3);
  const normal = new Float32Array(rows * across * 3);
  for (let i = 0; i < rows; i++) {
    for (let j = 0; j < across; j++) {
      const r = radius(values[i * columns + (j % columns)]);
      const [x, y, z] = unit(theta[i], phi[j % columns]);
      position.set([r * x, r * y, below ? -r * z : r * z], 3 * (i * across + j));
    }
  }
  const point = (i, j) => position.subarray(3 * (i * across + j), 3 * (i * across + j) + 3);
  const apart = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  for (let i = 0; i < rows; i++) {
    for (let j = 0; j < across; j++) {
      const down = apart(point(Math.min(i + 1, rows - 1), j), point(Math.max(i - 1, 0), j));
      const [left, right] = [j > 0 ? j - 1 : across - 2, j < across - 1 ? j + 1 : 1];
      let n = cross(down, apart(point(i, right), point(i, left)));
      const length = Math.hypot(...n);
      n = length > 1e-12 ? scaled(n, 1 / length) : unit(theta[i], phi[j % columns]);
      normal.set(n, 3 * (i * across + j));
    }
  }
  const faces = [];
  const lines = [];
  for (let i = 0; i < rows - 1; i++) {
    for (let j = 0; j < across - 1; j++) {
      const a = i * across + j;
      faces.push(a, a + across, a + 1, a + 1, a + across, a + across + 1);
    }
  }
  const every = (count, wanted) => Math.max(1, Math.round(count / wanted));
  for (let i = 0; i < rows; i += every(rows, 12))
    for (let j = 0; j < across - 1; j++) lines.push(i * across + j, i * across + j + 1);
  for (let j = 0; j < across; j += every(across, 16))
    for (let i = 0; i < rows - 1; i++) lines.push(i * across + j, (i + 1) * across + j);
  return { position, normal, faces, lines };
}

/** Return a tube along a direction from one distance to another, a cone if its end has no width. */
function tube(way, from, to, wide, end, position, faces) {
  const side = cross(way, Math.abs(way[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0]);
  const a = scaled(side, 1 / Math.hypot(...side));
  const b = cross(way, a);
  const first = position.length / 3;
  for (let k = 0; k <= 12; k++) {
    const around = sum(scaled(a, Math.cos((k * Math.PI) / 6)), scaled(b, Math.sin((k * Math.PI) / 6)));
    position.push(...sum(scaled(way, from), scaled(around, wide)), ...sum(scaled(way, to), scaled(around, end)));
    if (k)
      faces.push(
        first + 2 * k - 2,
        first + 2 * k - 1,
        first + 2 * k,
        first + 2 * k,
        first + 2 * k - 1,
        first + 2 * k + 1,
      );
  }
}

/** Return what stands beside the lobe: wi, its mirror direction, the normal, the tangent u and the surface's disc. */
export function furniture(wi) {
  const position = [];
  const faces = [];
  tube(wi, 0, ARROW - 0.1, 0.009, 0.009, position, faces);
  tube(wi, ARROW - 0.1, ARROW + 0.03, 0.04, 0, position, faces);
  const mirror = [-wi[0], -wi[1], wi[2]];
  for (let k = 0; k < 12; k++) tube(mirror, 0.1 * k, 0.1 * k + 0.05, 0.006, 0.006, position, faces);
  tube([0, 0, 1], 0, 1.08, 0.003, 0.003, position, faces);
  tube([1, 0, 0], 0, 1, 0.003, 0.003, position, faces);
  const lines = [];
  const ring = position.length / 3;
  for (let k = 0; k < 96; k++) {
    position.push(Math.cos((k * Math.PI) / 48), Math.sin((k * Math.PI) / 48), 0);
    lines.push(ring + k, ring + ((k + 1) % 96));
  }
  return { position: new Float32Array(position), normal: new Float32Array(position.length), faces, lines };
}
