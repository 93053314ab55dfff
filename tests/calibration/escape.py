"""The tables of multiple scattering: how much light escapes from Smith's surfaces at the first reflection, by
quadrature in float64, and what becomes of the rest, by random walks.

    python tests/calibration/escape.py [--check]

Writes mi_brdfs/microfacet/escape.npz; with --check, exits with 1 if every seventh row and column made anew, of fewer
walks, differ from it by more than their noise. The walks of Beckmann's facets serve for Blinn's, too, which have about
the same shapes.
"""

from __future__ import annotations

import itertools
import sys
from typing import NamedTuple

from harness import parser
from scipy.interpolate import RegularGridInterpolator
from scipy.special import erfc, erfinv

from mi_brdfs.microfacet.escape import BENDS, COUNTS, FILE, ISOTROPIC, ROUGHEST, SKEW, evened

import drjit as dr  # after mi_brdfs, which chooses the LLVM that they load  # isort: skip
import mitsuba as mi  # isort: skip
import numpy as np  # isort: skip

ALPHAS, RATIOS = 43, 31
BRIGHTER = 0.008
"""What polynomials may add to E where they err most, on facets of extreme anisotropy."""
WALK_COSINES, WALK_ALPHAS = 15, 10
"""Nodes of the walks: what they say changes less, and splines are drawn through it."""
WALKS = 1 << 15
REFLECTIONS = 10
TYPICAL = 0.85
"""What facets reflect where paths are averaged: as metals do, of which most light is lost at the first reflections."""
CORRELATIONS = 0, 0.5
"""The ρ² of nodes; what walks say is nearly linear in it."""


def alphas(places: np.ndarray) -> np.ndarray:
    """Return the roughness at places in [0, 1]."""
    x = places * ROUGHEST / (1 + ROUGHEST)
    return np.maximum(x / (1 - x), 1e-3)


def azimuth(along: np.ndarray, across: np.ndarray, rho2: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return ``(φ, αu, αv)`` for the roughness along the direction and across, and ρ²."""
    rho = np.sqrt(rho2) * along * across
    mean, half = (along**2 + across**2) / 2, np.hypot((along**2 - across**2) / 2, rho)
    u2 = mean + half
    v2 = along**2 * across**2 * (1 - rho2) / u2
    return 0.5 * np.arctan2(2 * rho, along**2 - across**2), np.sqrt(u2), np.sqrt(v2)


# --- The first reflection -------------------------------------------------------------------------------------------


NODES, WEIGHTS = ((1 + x) / 2 if k == 0 else x / 2 for k, x in enumerate(np.polynomial.legendre.leggauss(64)))


def along_slopes(low: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return slopes from ``low`` on, at even steps of their angle, and their weights."""
    first = np.arctan(low)
    angle = first + (np.pi / 2 - first) * NODES[:, None]
    return np.tan(angle), (np.pi / 2 - first) * WEIGHTS[:, None] / np.cos(angle) ** 2


def ggx_slopes(low: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    x, weight = along_slopes(low)
    angle = np.pi * (NODES - 0.5)
    return x, np.sqrt(1 + x * x) * np.tan(angle), weight * 0.5 / (1 + x * x) ** 1.5 * 2 * np.cos(angle) ** 2 * WEIGHTS


def beckmann_slopes(low: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    x, weight = along_slopes(low)
    return x, erfinv(2 * NODES - 1) + 0 * x, weight * np.exp(-x * x) / np.sqrt(np.pi) * WEIGHTS


def ggx_lambda(tan: np.ndarray) -> np.ndarray:
    return 0.5 * (np.sqrt(1 + tan * tan) - 1)


def beckmann_lambda(tan: np.ndarray) -> np.ndarray:
    a = 1 / np.maximum(tan, 0.04)
    return 0.5 * (np.exp(-a * a) / (a * np.sqrt(np.pi)) - erfc(a))


def blinn_lambda(tan: np.ndarray) -> np.ndarray:
    """Walter et al.'s approximation of Beckmann's."""
    a = 1 / np.maximum(tan, 1e-9)
    return np.where(a < 1.6, (1 + 2.276 * a + 2.577 * a * a) / (3.535 * a + 2.181 * a * a) - 1, 0)


SHAPES = {"ggx": (ggx_slopes, ggx_lambda), "beckmann": (beckmann_slopes, beckmann_lambda)}


def lost(shape: str, cos: float, phi: float, alpha_u: float, alpha_v: float) -> np.ndarray:
    """Return 1 - E of a direction, for the separable and the correlated term, over the slopes that are visible from it
    in the space stretched to α = 1."""
    slopes, lambda_of = SHAPES[shape]
    sin = np.sqrt(1 - cos * cos)
    wi = sin * np.cos(phi), sin * np.sin(phi), cos

    def smith(w):
        return lambda_of(np.sqrt((alpha_u * w[0]) ** 2 + (alpha_v * w[1]) ** 2) / np.maximum(w[2], 1e-9))

    u, v = alpha_u * wi[0], alpha_v * wi[1]
    length = np.hypot(u, v)
    x, y, weight = slopes(-cos / length)
    weight = weight * np.maximum(cos + x * length, 0)
    hx, hy = alpha_u * (x * u - y * v) / length, alpha_v * (x * v + y * u) / length
    cos_d = (wi[0] * hx + wi[1] * hy + wi[2]) / (1 + hx * hx + hy * hy)
    wo = 2 * cos_d * hx - wi[0], 2 * cos_d * hy - wi[1], 2 * cos_d - wi[2]
    return 1 - np.sum(weight * shadowed(smith(wi), smith(wo), wo[2]), axis=(1, 2)) / np.sum(weight)


def shadowed(i: float, o: np.ndarray, cos_o: np.ndarray) -> np.ndarray:
    """Return the part of what facets reflect that leaves the surface, for Λ of both directions and either term."""
    return np.where(cos_o > 0, [1 / (1 + o), (1 + i) / (1 + i + o)], 0)


def blinn_lost(cos: float, alpha: float) -> np.ndarray:
    """Return 1 - E of Blinn's facets, over their half vectors: its Λ is an approximation, so that they are not what
    Smith's masking sees, and E may exceed 1."""
    exponent = 2 / alpha**2 - 2
    cos_h = (1 - NODES[:, None]) ** (1 / (exponent + 2))
    sin_h, psi = np.sqrt(1 - cos_h * cos_h), 2 * np.pi * (np.arange(64) + 0.5) / 64
    sin = np.sqrt(1 - cos * cos)
    hx, hy = sin_h * np.cos(psi), sin_h * np.sin(psi)
    cos_d = np.maximum(sin * hx + cos * cos_h, 0)
    wo = 2 * cos_d * hx - sin, 2 * cos_d * hy, 2 * cos_d * cos_h - cos
    i = blinn_lambda(alpha * sin / cos)
    o = blinn_lambda(alpha * np.hypot(*wo[:2]) / np.maximum(wo[2], 1e-9))
    seen = cos_d / (cos * cos_h) * shadowed(i, o, wo[2]) / (1 + i)
    return 1 - np.sum(WEIGHTS[:, None] * seen, axis=(1, 2)) / 64


# --- The walk -------------------------------------------------------------------------------------------------------


def height_exponent(shape: str, w: mi.Vector3f, alpha_u: mi.Float, alpha_v: mi.Float) -> mi.Float:
    """Return Λ of a direction, or of its opposite one if that points upward."""
    tan = dr.sqrt(dr.square(alpha_u * w.x) + dr.square(alpha_v * w.y)) / dr.maximum(abs(w.z), 1e-7)
    if shape == "ggx":
        return 0.5 * tan * tan / (1 + dr.sqrt(1 + tan * tan))
    a = dr.rcp(dr.maximum(tan, 0.25))
    return 0.5 * dr.maximum(dr.exp(-a * a) / (a * np.sqrt(np.pi)) - (1 - dr.erf(a)), 0)


def visible_normal(
    shape: str, wi: mi.Vector3f, alpha_u: mi.Float, alpha_v: mi.Float, u: mi.Float, v: mi.Float
) -> mi.Vector3f:
    """Draw a normal that is visible from a direction, which may point downward, out of the surface."""
    w = dr.normalize(mi.Vector3f(alpha_u * wi.x, alpha_v * wi.y, wi.z))
    if shape == "ggx":
        z = 1 - (1 + w.z) * v
        sin, (s, c) = dr.safe_sqrt(1 - z * z), dr.sincos(dr.two_pi * u)
        sum = mi.Vector3f(sin * c, sin * s, z) + w
        return dr.normalize(mi.Vector3f(alpha_u * sum.x, alpha_v * sum.y, dr.maximum(sum.z, 1e-7)))
    sin = dr.sqrt(dr.maximum(1 - w.z * w.z, 1e-12))

    def cumulated(x):
        return 0.5 * (w.z * dr.erf(x) - sin * dr.exp(-x * x) / np.sqrt(np.pi))

    low, high = dr.maximum(-w.z / sin, -5), mi.Float(5)
    sought = dr.lerp(cumulated(low), cumulated(high), u)
    for _ in range(22):
        middle = 0.5 * (low + high)
        below = cumulated(middle) < sought
        low, high = dr.select(below, middle, low), dr.select(below, high, middle)
    y = dr.erfinv(dr.clip(2 * v - 1, -0.999999, 0.999999))
    x, c, s = 0.5 * (low + high), w.x / sin, w.y / sin
    return dr.normalize(mi.Vector3f(alpha_u * (x * c - y * s), alpha_v * (x * s + y * c), 1))


def walks(shape: str, cos: np.ndarray, phi: np.ndarray, alpha_u: np.ndarray, alpha_v: np.ndarray, count: int) -> dict:
    """Return, for each setting, of walks that do not escape at the first reflection: the parts that escape at the
    second, and at the third of what is left; over paths weighed as TYPICAL says, the means of (1 - cosθ_d)⁵ and
    cosθ_d (1 - cosθ_d)⁶ at the first reflection, those of their sums over the later ones, and of the number of these;
    and the means at the second reflection, over what does not escape there."""
    at = dr.repeat(dr.arange(mi.UInt32, len(cos)), count)
    cos, phi, alpha_u, alpha_v = (
        dr.gather(mi.Float, mi.Float(np.float32(each)), at) for each in (cos, phi, alpha_u, alpha_v)
    )
    sin, (y, x) = dr.safe_sqrt(1 - cos * cos), dr.sincos(phi)
    size = dr.width(at)
    w, below, energy = -mi.Vector3f(sin * x, sin * y, cos), dr.ones(mi.Float, size), dr.ones(mi.Float, size)
    rng, cos_d = mi.PCG32(size=size), dr.zeros(mi.Float, size)
    first, later = dr.zeros(mi.Vector2f, size), dr.zeros(mi.Vector2f, size)
    paths = [dr.zeros(mi.Float, size) for _ in range(6)]
    escaped, left, between = [], [], []
    for reflection in range(REFLECTIONS + 1):
        # ``below`` is the part of the heights that are lower. A ray leaves the surface with probability below^Λ: take
        # that part of its energy, so that no walk ends.
        exponent, up = height_exponent(shape, w, alpha_u, alpha_v), w.z > 0
        leaves = dr.select(up, dr.power(below, exponent), 0) if reflection else dr.zeros(mi.Float, size)
        gone, energy = energy * leaves, energy * (1 - leaves)
        if reflection == 1:
            first = _moments(cos_d)
        elif reflection > 1:
            escaped.append(_means(gone, count))
            later += _moments(cos_d)
            weight, moments = gone * TYPICAL ** (reflection - 2), (1, *first, *later, reflection - 1)
            paths = [dr.fma(weight, moment, path) for moment, path in zip(moments, paths, strict=True)]
            if reflection == 2:
                between = [_means(energy * moment, count) for moment in _moments(cos_d)]
        if reflection:
            left.append(_means(energy, count))
        u = dr.fma(rng.next_float32(), 1 - leaves, leaves)  # of rays that stay
        rises = dr.minimum(below * dr.power(dr.maximum(u, 1e-9), -dr.rcp(dr.maximum(exponent, 1e-7))), 1)
        below = dr.select(up, rises, below * dr.power(dr.maximum(u, 1e-9), dr.rcp(1 + exponent)))
        h = visible_normal(shape, -w, alpha_u, alpha_v, rng.next_float32(), rng.next_float32())
        cos_d = dr.clip(-dr.dot(w, h), 0, 1)
        w = dr.normalize(dr.fma(h, 2 * cos_d, w))
        dr.eval(w, below, energy, cos_d, rng, first, later, paths)
    total, *sums = (_means(each, count) for each in paths)
    return {
        "second": escaped[0] / left[0],
        "third": escaped[1] / left[1],
        "paths": np.stack(sums) / total,
        "left": left[1] / left[0],
        "between": np.stack(between) / left[1],
    }


def _moments(cos: mi.Float) -> mi.Vector2f:
    m = 1 - cos
    schlick = dr.square(dr.square(m)) * m
    return mi.Vector2f(schlick, cos * m * schlick)


def _means(values: mi.Float, count: int) -> np.ndarray:
    return dr.block_sum(values, count).numpy().astype(np.float64) / count


# --- The tables -----------------------------------------------------------------------------------------------------


def walk_tables(shape: str, count: int) -> dict[str, RegularGridInterpolator]:
    """Return what :func:`walks` finds, by the root of the cosine and the places of the roughness along and across, as
    the coefficients of a line in ρ²: shape (…, 2, channels)."""
    rough = alphas(np.linspace(0, 1, WALK_ALPHAS))
    nodes = np.linspace(0, 1, WALK_COSINES), rough, rough, CORRELATIONS
    grid = [each.ravel() for each in np.meshgrid(*nodes, indexing="ij")]
    settings = [np.clip(grid[0] ** 2, 1e-3, 1 - 1e-6), *azimuth(*grid[1:])]
    found = [walks(shape, *(each[k : k + 64] for each in settings), count) for k in range(0, len(grid[0]), 64)]
    axes = np.linspace(0, 1, WALK_COSINES), *2 * [np.linspace(0, 1, WALK_ALPHAS)]
    tables = {}
    for name in found[0]:
        values = np.concatenate([each[name].reshape(-1, len(each["second"])) for each in found], axis=1)
        values = values.reshape(-1, *map(len, axes), 2)
        # Where nothing is lost, as on smooth surfaces from above, take what rougher ones do.
        for i, j in itertools.product(reversed(range(WALK_ALPHAS - 1)), repeat=2):
            here, rougher = values[:, :, i, j], values[:, :, i + 1, j + 1]
            here[...] = np.where(np.isfinite(here), here, rougher)
        start, end = np.moveaxis(values, (-1, 0), (0, -1))
        line = np.stack([start, (end - start) / CORRELATIONS[1]], axis=-2)
        tables[name] = RegularGridInterpolator(axes, line, method="cubic")
    return tables


def fitted(shape: str, largest: float, ratio: float, walked: dict[str, RegularGridInterpolator]) -> list[np.ndarray]:
    """Return, for facets with the largest α and its ratio to the smallest, and the separable and the correlated term,
    the entries of :data:`.escape.COUNTS`: of the means the first as its root."""
    u, v = largest, largest * ratio
    phi = np.zeros(1)
    if ratio < 1:
        low, high = skewed(ratio), skewed(1 / ratio)
        y = low + (high - low) * chebyshev(9)
        along2 = ratio * (1 + SKEW * y) / (1 - y)
        between = np.arccos(np.sqrt(np.clip((along2 - ratio**2) / (1 - ratio**2), 0, 1)))
        phi = np.append(np.linspace(0, np.pi / 2, 9), between)
    # Half of the places are even in the stretched space, most of which is at grazing where facets are smooth.
    upright = np.cos(np.radians([1, 15, 30, 45, 55, 65, 72, 78, 83, 87]))
    above = Places.of(upright, phi, u, v)
    places = Places.joined(above, Places.of(chebyshev(13), phi, u, v, stretched=True))
    stretched = np.arange(len(places.cos)) >= len(above.cos)
    # Smooth surfaces lose what they lose near the horizon.
    everywhere = Places.of(NODES**3, np.pi / 2 * (np.arange(16) + 0.5) / 16, u, v)
    losses = np.array([
        blinn_lost(cos, u) if shape == "blinn" else lost(shape, cos, angle, u, v)
        for cos, angle in zip(places.cos, places.phi, strict=True)
    ])  # fmt: skip
    entries = []
    for raw, (most, falling) in zip(losses.T, BENDS[shape], strict=True):
        loss = np.clip(raw, 0, 1)
        bend = most / (1 + falling * (u * u + v * v) / 2)
        # What a lobe is scaled by errs as 1 - E over E. Where next to nothing is lost, and in most directions, the lobe
        # must stay as it was.
        scale = np.minimum(1 / (1 - loss), 3)
        scale *= np.where(~stretched & (places.cos > 0.4), np.maximum(0.1 / (0.02 + loss), 1), 1)
        # Within .3° of the horizon, correlated terms lose next to nothing: polynomials may add more than that there.
        brighter = np.where(places.cos > 0.005, np.minimum(loss, BRIGHTER), BRIGHTER)
        gains = raw < -0.01
        polynomial = not_brighter(
            places.terms("lost", bend), loss, np.where(gains, 0.1, scale), np.where(gains, np.inf, brighter)
        )
        means, *later = after_the_first(walked, above, everywhere, lost_at(everywhere, polynomial, bend))
        # What they colour is to err less up to some 60° than near the horizon.
        weights = (0.02 + lost_at(above, polynomial, bend)) * np.where(above.cos > 0.4, 3, 1)
        others = [
            np.linalg.lstsq(above.terms(name) * weights[:, None], values * weights, rcond=None)[0]
            for name, values in zip(("second", "schlick", "dip"), later, strict=True)
        ]
        second, schlick, dip = others
        entries.append(np.concatenate([polynomial, means[:1], second, schlick, means[1:4], dip, means[4:]]))
    return entries


def skewed(along2: np.ndarray) -> np.ndarray:
    """Return the second variable of polynomials, for α² over αu αv."""
    return (along2 - 1) / (along2 + SKEW)


def chebyshev(count: int) -> np.ndarray:
    """Return places in [0, 1] for a polynomial to go through."""
    return (1 - np.cos(np.pi * (np.arange(count) + 0.5) / count)) / 2


def not_brighter(terms: np.ndarray, loss: np.ndarray, scale: np.ndarray, brighter: np.ndarray) -> np.ndarray:
    """Return the coefficients with the least largest error in some scale, of 16 bits: the mean that the lobe is divided
    by must be that of what is looked up. They are lowered to where they add no more light than ``brighter``."""
    weights, best, least = np.ones(len(loss)), np.zeros(terms.shape[1]), np.inf
    for _ in range(25):
        k = np.linalg.lstsq(terms * (weights * scale)[:, None], loss * weights * scale, rcond=None)[0]
        error = abs(terms @ k - loss) * scale
        if error.max() < least:
            best, least = k, error.max()
        weights *= np.sqrt(0.3 + error / error.mean())
        weights /= weights.mean()
    best = best.astype(np.float16).astype(float)
    excess = (terms @ best - loss - brighter).max()
    if excess > 0:
        best[0] = np.nextafter(np.float16(best[0] - excess), np.float16(-1))
    return best


class Places(NamedTuple):
    """Directions above facets."""

    cos: np.ndarray
    phi: np.ndarray
    shortened: np.ndarray
    """The cosine in the stretched space."""
    at: np.ndarray
    """Places in the tables of walks."""
    rho2: np.ndarray
    y: np.ndarray
    """The second variable of polynomials."""

    @classmethod
    def of(cls, cos: np.ndarray, phi: np.ndarray, alpha_u: float, alpha_v: float, stretched: bool = False) -> Places:
        """Return those of all cosines, of the ``stretched`` space or not, and azimuths."""
        cos, phi = (each.ravel() for each in np.meshgrid(cos, phi))
        along2 = (alpha_u * np.cos(phi)) ** 2 + (alpha_v * np.sin(phi)) ** 2
        across2 = alpha_u**2 + alpha_v**2 - along2
        if stretched:
            cos = 1 / np.sqrt(1 + (1 / cos**2 - 1) / along2)
        tan2 = 1 / cos**2 - 1
        shortened = 1 / np.sqrt(1 + along2 * tan2)
        rough = [(1 + 1 / ROUGHEST) * np.sqrt(a2) / (1 + np.sqrt(a2)) for a2 in (along2, across2)]
        rho2 = np.maximum(1 - (alpha_u * alpha_v) ** 2 / (along2 * across2), 0)
        at = np.stack([np.sqrt(cos), *rough], axis=-1)
        return cls(cos, phi, shortened, at, rho2, skewed(along2 / (alpha_u * alpha_v)))

    @classmethod
    def joined(cls, *places: Places) -> Places:
        return cls(*(np.concatenate(each) for each in zip(*places, strict=True)))

    def terms(self, name: str, bend: float = 1) -> np.ndarray:
        x, y, factor = 1 - self.cos, evened(self.y), 1 - self.cos
        if name == "lost":
            x, y = 2 * self.shortened / (self.shortened + bend * (1 - self.shortened)) - 1, self.y
            factor = np.ones(len(self.cos))
        powers = [(i, j) for j, count in enumerate(COUNTS[name]) for i in range(count)]
        return np.stack([x**i * y**j * factor ** min(j, 1) for i, j in powers], axis=-1)


def lost_at(places: Places, polynomial: np.ndarray, bend: float) -> np.ndarray:
    return np.maximum(places.terms("lost", bend) @ polynomial, 0)


def after_the_first(
    walked: dict[str, RegularGridInterpolator], places: Places, everywhere: Places, loss: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Return the means over the hemisphere, of which ``everywhere`` are the places and ``loss`` is what is lost there,
    and at other places what escapes at the second reflection, and both moments that colour the walk from there.

    These are those of the first reflection, and what those of later ones differ by from their means, as far as the
    first leaves light: a facet that is seen at a grazing angle sends light to others at such angles, if all are rough
    along one axis alone.
    """

    def at(places: Places, name: str) -> np.ndarray:
        """Return what a table has at places, a row for each channel."""
        start, slope = np.moveaxis(walked[name](places.at), 0, -1)
        return start + places.rho2 * slope

    def mean(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
        return np.sum(values * weights, axis=1, keepdims=True) / np.sum(weights)

    loss = np.tile(WEIGHTS * 3 * NODES**2, 16) / 16 * 2 * everywhere.cos * loss
    left = loss * at(everywhere, "left")[0]
    second, third = mean(at(everywhere, "second"), loss), mean(at(everywhere, "third"), left)
    between = mean(at(everywhere, "between"), left)

    def moments(places: Places) -> tuple[np.ndarray, np.ndarray]:
        """Return those of the first reflection, and what those of later ones differ by from their means."""
        paths = at(places, "paths")
        return paths[:2], TYPICAL * (paths[2:4] - between * paths[4])

    (first, later), (first_everywhere, later_everywhere) = moments(places), moments(everywhere)
    colours = first + later - mean(later_everywhere, loss)
    colour_means = np.hstack([between, mean(first_everywhere, loss)])
    means = np.concatenate([[np.sqrt(np.sum(loss))], *third, *colour_means])
    return means, *(at(places, "second") - 0.5 * second), *colours


def made(count: int, step: int = 1) -> dict[str, np.ndarray]:
    """Return all tables, of ``count`` walks for each setting, or each ``step``-th row and column of them."""
    tables = {}
    walked = {shape: walk_tables(shape, count) for shape in SHAPES}
    roughness = alphas(np.linspace(0, 1, ALPHAS) ** 2)[::step]
    for shape, walk in {**walked, "blinn": walked["beckmann"]}.items():
        ratios = [1.0] if shape == "blinn" else np.maximum(np.linspace(0, 1, RATIOS), 0.1)[::step] ** 4
        rows = np.float16([[fitted(shape, alpha, ratio, walk) for alpha in roughness] for ratio in ratios])
        if len(ratios) > 1 and ratios[-1] == 1:
            # Isotropic facets do not tell how what is nearly so depends on the azimuth.
            rows[-1][..., ~ISOTROPIC] = rows[-2][..., ~ISOTROPIC]
        tables[f"{shape}-separable"], tables[f"{shape}-correlated"] = np.moveaxis(rows, 2, 0)
    return tables


if __name__ == "__main__":
    checked = parser(__doc__).parse_args().check
    mi.set_variant("llvm_ad_rgb")
    if not checked:
        np.savez_compressed(FILE, **made(WALKS))
        print(f"{FILE}: {FILE.stat().st_size} bytes")
        sys.exit()
    wrong, step, first = False, 7, sum(COUNTS["lost"])
    with np.load(FILE) as kept:
        for name, table in made(WALKS >> 4, step).items():
            error = abs(table.astype(float) - kept[name][::step, ::step])
            # By the median, as what little light does is noise; the first reflection has none, but rounding to 16 bits.
            exact, walked = float(error[..., :first].max()), float(np.median(error[..., first:]))
            print(f"{name}: {exact:.4f}, {walked:.4f}")
            wrong |= exact > 5e-3 or walked > 0.02
    sys.exit(wrong)
