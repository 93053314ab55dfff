"""The tables of multiple scattering: how much light escapes from Smith's surfaces at the first reflection, by
quadrature in float64, and what becomes of the rest, by random walks.

    python tests/calibration/escape.py [--check]

Writes mi_brdfs/microfacet/escape.npz; with --check, exits with 1 if tables made anew, of fewer walks and the first
reflection at every third roughness, differ from it by more than their noise. The walks of Beckmann's facets serve for
Blinn's, too, which have about the same shapes.
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Mapping

from harness import parser
from scipy.interpolate import RegularGridInterpolator
from scipy.special import erfc, erfinv

from mi_brdfs.microfacet.escape import FILE, ROUGHEST, UPRIGHT

import drjit as dr  # after mi_brdfs, which chooses the LLVM that they load  # isort: skip
import mitsuba as mi  # isort: skip
import numpy as np  # isort: skip

COSINES, ALPHAS = 28, 28
WALK_COSINES, WALK_ALPHAS = 13, 9
"""Nodes of the walks: what they say changes less, and splines are drawn through it."""
WALKS = 1 << 15
REFLECTIONS = 10
TYPICAL = 0.85
"""What facets reflect where paths are averaged: as metals do, of which most light is lost at the first reflections."""
CORRELATIONS = 0, 0.5, 0.9
"""The ρ² of polynomials for E; those for walks are lines through the first and the second."""


def alphas(count: int) -> np.ndarray:
    """Nodes of the roughness, which are evenly spaced in α/(1 + α)."""
    x = np.linspace(0, ROUGHEST / (1 + ROUGHEST), count)
    return np.maximum(x / (1 - x), 1e-3)


def direction(cos: np.ndarray, along: np.ndarray, across: np.ndarray, rho2: float) -> tuple[np.ndarray, ...]:
    """Return ``(cosθ, φ, αu, αv)`` for a stretched cosine, the roughness along the direction and across, and ρ²."""
    rho = np.sqrt(rho2) * along * across
    mean, half = (along**2 + across**2) / 2, np.hypot((along**2 - across**2) / 2, rho)
    u2 = mean + half
    v2 = along**2 * across**2 * (1 - rho2) / u2
    tan = np.sqrt(1 / np.clip(cos, 1e-3, 1 - 1e-9) ** 2 - 1) / along
    return 1 / np.hypot(1, tan), 0.5 * np.arctan2(2 * rho, along**2 - across**2), np.sqrt(u2), np.sqrt(v2)


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
    return 0.5 * (np.hypot(1, tan) - 1)


def beckmann_lambda(tan: np.ndarray) -> np.ndarray:
    a = 1 / np.maximum(tan, 0.04)
    return 0.5 * (np.exp(-a * a) / (a * np.sqrt(np.pi)) - erfc(a))


def blinn_lambda(tan: np.ndarray) -> np.ndarray:
    """Walter et al.'s approximation of Beckmann's."""
    a = 1 / np.maximum(tan, 1e-9)
    return np.where(a < 1.6, (1 + 2.276 * a + 2.577 * a * a) / (3.535 * a + 2.181 * a * a) - 1, 0)


SHAPES = {"ggx": (ggx_slopes, ggx_lambda), "beckmann": (beckmann_slopes, beckmann_lambda)}


def lost(shape: str, correlated: bool, cos: float, phi: float, alpha_u: float, alpha_v: float) -> float:
    """Return 1 - E of a direction, over the slopes that are visible from it in the space stretched to α = 1."""
    slopes, lambda_of = SHAPES[shape]
    sin = np.sqrt(1 - cos * cos)
    wi = sin * np.cos(phi), sin * np.sin(phi), cos

    def smith(w):
        return lambda_of(np.hypot(alpha_u * w[0], alpha_v * w[1]) / np.maximum(w[2], 1e-9))

    u, v = alpha_u * wi[0], alpha_v * wi[1]
    length = np.hypot(u, v)
    x, y, weight = slopes(-cos / length)
    weight = weight * np.maximum(cos + x * length, 0)
    hx, hy = alpha_u * (x * u - y * v) / length, alpha_v * (x * v + y * u) / length
    cos_d = (wi[0] * hx + wi[1] * hy + wi[2]) / (1 + hx * hx + hy * hy)
    wo = 2 * cos_d * hx - wi[0], 2 * cos_d * hy - wi[1], 2 * cos_d - wi[2]
    return float(np.sum(weight * (1 - shadowed(smith(wi), smith(wo), wo[2], correlated))) / np.sum(weight))


def shadowed(i: float, o: np.ndarray, cos_o: np.ndarray, correlated: bool) -> np.ndarray:
    """Return the part of what facets reflect that leaves the surface, for Λ of both directions."""
    return np.where(cos_o > 0, (1 + i) / (1 + i + o) if correlated else 1 / (1 + o), 0)


def blinn_lost(correlated: bool, cos: float, alpha: float) -> float:
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
    seen = cos_d / (cos * cos_h) * shadowed(i, o, wo[2], correlated) / (1 + i)
    return 1 - float(np.sum(WEIGHTS[:, None] * seen) / 64)


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
    second, and at the third of what is left; and the means of (1 - cosθ_d)⁵ and cosθ_d (1 - cosθ_d)⁶ at the first
    reflection, over paths weighed as TYPICAL says, and at the second, over what does not escape there."""
    at = dr.repeat(dr.arange(mi.UInt32, len(cos)), count)
    cos, phi, alpha_u, alpha_v = (
        dr.gather(mi.Float, mi.Float(np.float32(each)), at) for each in (cos, phi, alpha_u, alpha_v)
    )
    sin, (y, x) = dr.safe_sqrt(1 - cos * cos), dr.sincos(phi)
    size = dr.width(at)
    w, below, energy = -mi.Vector3f(sin * x, sin * y, cos), dr.ones(mi.Float, size), dr.ones(mi.Float, size)
    rng, cos_d = mi.PCG32(size=size), dr.zeros(mi.Float, size)
    first, paths = dr.zeros(mi.Vector2f, size), dr.zeros(mi.Vector3f, size)
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
            paths += gone * TYPICAL ** (reflection - 2) * mi.Vector3f(1, first.x, first.y)
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
        dr.eval(w, below, energy, cos_d, rng, first, paths)
    total, schlick, dip = (_means(each, count) for each in paths)
    return {
        "second": escaped[0] / left[0],
        "third": escaped[1] / left[1],
        "schlick": schlick / total,
        "dip": dip / total,
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
    """Return what :func:`walks` finds, by the places of stretched cosine and roughness along and across, as the
    coefficients of a line in ρ²: shape (…, 2, channels)."""
    nodes = np.linspace(0, 1, WALK_COSINES), alphas(WALK_ALPHAS), alphas(WALK_ALPHAS), CORRELATIONS[:2]
    grid = [each.ravel() for each in np.meshgrid(*nodes, indexing="ij")]
    settings = [each.ravel() for each in np.broadcast_arrays(*direction(*grid[:3], rho2=grid[3]))]
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


def first_table(shape: str, correlated: bool, step: int) -> np.ndarray:
    """Return 1 - E at some of the roughnesses, as the coefficients of a parabola in ρ²: shape (cosines, along, across,
    3); for Blinn's facets, which are isotropic, (cosines, along, 1, 3)."""
    cos, alpha = np.linspace(0, 1, COSINES), alphas(ALPHAS)[::step]
    if shape == "blinn":
        values = np.array([[blinn_lost(correlated, direction(c, a, a, 0)[0], a) for a in alpha] for c in cos])
        return np.stack([values, 0 * values, 0 * values], axis=-1)[:, :, None]
    grid = itertools.product(cos, alpha, alpha, CORRELATIONS)
    values = np.array([lost(shape, correlated, *map(float, direction(*at))) for at in grid])
    to_parabola = np.linalg.inv(np.vander(CORRELATIONS, increasing=True)).T
    return values.reshape(COSINES, len(alpha), len(alpha), 3) @ to_parabola


def tables_of(
    shape: str, first: np.ndarray, walked: dict[str, RegularGridInterpolator]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the tables of walks towards directions and of means, as :mod:`mi_brdfs.microfacet.escape` reads them."""
    places = [np.linspace(0, 1, count) for count in first.shape[:3]]
    if shape == "blinn":
        places[2] = places[1]
    x = np.stack(np.meshgrid(*places, indexing="ij"), axis=-1)

    def line(name):
        values = walked[name](x)[..., 0]
        return np.diagonal(values, axis1=1, axis2=2).transpose(0, 2, 1)[:, :, None] if shape == "blinn" else values

    walk = np.concatenate([line("second"), line("schlick"), line("dip")[..., :1]], axis=-1)
    return walk, mean_table(shape, first, walked)


def mean_table(shape: str, first: np.ndarray, walked: dict[str, RegularGridInterpolator]) -> np.ndarray:
    """Return means over the hemisphere for αu and αv, the root of 1 - E first, which is nearly
    proportional to α: shape (αu, αv, 8); for Blinn's facets, (α, 1, 8)."""
    phi = np.pi / 2 * (np.arange(8) + 0.5) / 8
    axes = [np.linspace(0, 1, count) for count in first.shape[:2]]
    if shape == "blinn":
        look_up = RegularGridInterpolator(axes, first[:, :, 0])
    else:
        look_up = RegularGridInterpolator([*axes, axes[1]], first)
    alpha = alphas(ALPHAS)
    result = np.zeros((ALPHAS, 1 if shape == "blinn" else ALPHAS, 8))
    for i, j in np.ndindex(result.shape[:2]):
        u2, v2 = alpha[i] ** 2, alpha[i if shape == "blinn" else j] ** 2
        c, x2 = NODES[:, None], np.cos(phi) ** 2
        stretched = c / np.sqrt(c * c + (u2 * x2 + v2 * (1 - x2)) * (1 - c * c))
        x2 = ((1 - c * c) * x2 + UPRIGHT * c**4) / (1 - c * c + 2 * UPRIGHT * c**4)
        along2, across2 = u2 * x2 + v2 * (1 - x2), u2 * (1 - x2) + v2 * x2
        place = [(1 + 1 / ROUGHEST) * np.sqrt(a2) / (1 + np.sqrt(a2)) for a2 in (along2, across2)]
        rho2 = np.maximum(1 - u2 * v2 / (along2 * across2), 0)
        k = look_up(np.stack([stretched, *place][: 2 if shape == "blinn" else 3], axis=-1))
        weight = WEIGHTS[:, None] * 2 * c / len(phi)
        lost = weight * np.maximum(k[..., 0] + rho2 * (k[..., 1] + rho2 * k[..., 2]), 0)
        at = np.stack([stretched, *place], axis=-1)

        def along_line(name, channel=0, at=at, rho2=rho2):
            start, slope = np.moveaxis(walked[name](at)[..., channel], -1, 0)
            return start + rho2 * slope

        left = lost * along_line("left")
        later = np.clip(along_line("third"), 0, 1), along_line("between", 0), along_line("between", 1)
        result[i, j, :2] = np.sqrt(np.sum(lost)), np.sum(lost * np.clip(along_line("second"), 0, 1)) / np.sum(lost)
        result[i, j, 2:5] = [np.sum(left * each) / np.sum(left) for each in later]
    return result


def made(count: int, step: int = 1, kept: Mapping[str, np.ndarray] | None = None) -> dict[str, np.ndarray]:
    """Return all tables, of ``count`` walks for each setting; those of the first reflection at each ``step``-th
    roughness, where ``kept`` tables of it go on in the others."""
    arrays = {}
    walked = {shape: walk_tables(shape, count) for shape in SHAPES}
    for shape, walk in {**walked, "blinn": walked["beckmann"]}.items():
        for correlated in (False, True):
            name = f"{shape}-{'correlated' if correlated else 'separable'}"
            arrays[name] = first_table(shape, correlated, step)
            first = arrays[name] if kept is None else kept[name].astype(float)
            arrays[f"{shape}-walk"], arrays[f"{name}-mean"] = tables_of(shape, first, walk)
    return {name: values.astype(np.float16) for name, values in arrays.items()}


if __name__ == "__main__":
    checked = parser(__doc__).parse_args().check
    mi.set_variant("llvm_ad_rgb")
    if not checked:
        np.savez_compressed(FILE, **made(WALKS))
        print(f"{FILE}: {FILE.stat().st_size} bytes")
        sys.exit()
    with np.load(FILE) as kept:
        errors, step = {}, 3
        for name, table in made(WALKS >> 4, step, kept).items():
            expected = kept[name] if table.shape == kept[name].shape else kept[name][:, ::step, ::step]
            # By the mean, as what little light does is noise.
            errors[name] = float(abs(table.astype(float) - expected).mean())
    print(*(f"{name}: {error:.4f}" for name, error in errors.items()), sep="\n")
    # The first reflection has no noise, but the rounding to 16 bits.
    sys.exit(any(error > (0.01 if name.endswith(("walk", "mean")) else 5e-4) for name, error in errors.items()))
