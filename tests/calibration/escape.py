"""The polynomials of multiple scattering: how much light escapes from Smith's surfaces at the first reflection, by
quadrature in float64, and what becomes of the rest, by random walks, of settings drawn at random.

    python tests/calibration/escape.py [--check]

Writes mi_brdfs/microfacet/escape.npz; with --check, exits with 1 if polynomials made anew, of fewer walks, differ from
it by more than their noise. The walks of Beckmann's facets serve for Blinn's, too, which have about the same shapes.
"""

from __future__ import annotations

import itertools
import sys

from harness import parser
from scipy.special import erfc, erfinv
from scipy.stats import qmc

from mi_brdfs.microfacet.escape import FILE

import drjit as dr  # after mi_brdfs, which chooses the LLVM that they load  # isort: skip
import mitsuba as mi  # isort: skip
import numpy as np  # isort: skip

SETTINGS, WALKED = 1 << 14, 1 << 11
WALKS = 1 << 12
REFLECTIONS = 10
TYPICAL = 0.85
"""What facets reflect where paths are averaged: as metals do, of which most light is lost at the first reflections."""
SMOOTHEST, ROUGHEST = 2e-3, 3.2
"""The range of α, of which the upper end is that of Burley's most anisotropic facets."""
PRECISE = 0.045, 1.05
"""That in which the fit counts most, up to 9:1 and 86°."""
DEGREES = {
    "ggx": (11, (1.15, 1.9, 1, 3)),
    "beckmann": (14, (1.25, 2.2, 1.1, 3.4)),
    "blinn": (11, (1, 1, 1, 1)),
    "second": (5, (1.1, 1.6, 1, 2)),
    "schlick": (5, (1.1, 1.6, 1, 2)),
    "dip": (4, (1.1, 1.6, 1, 2)),
    "mean": (9, (1, 2)),
}
"""Of each polynomial, and what the exponents of its variables count; those for facets are of 1 - E."""


def settings(count: int, isotropic: bool = False) -> tuple[np.ndarray, ...]:
    """Return ``(cosθ, φ, αu, αv)``, well spread; half of the directions are even in θ and half in the stretched
    cosine."""
    u = qmc.Sobol(6, seed=1).random(count).T
    low, high = np.where(u[4] < 0.7, 0.04, SMOOTHEST), np.where(u[4] < 0.7, 1.4, ROUGHEST)
    alpha = np.minimum(low * (high / low) ** u[0], 1.0 if isotropic else ROUGHEST)
    ratio = np.where(u[5] < 0.3, 1, np.where(u[5] < 0.8, 10, 40.0) ** u[1])
    other = alpha if isotropic else np.maximum(alpha / ratio, SMOOTHEST / 2)
    swapped = (u[5] * 64) % 1 < 0.5
    alpha_u, alpha_v, phi = np.where(swapped, other, alpha), np.where(swapped, alpha, other), np.pi / 2 * u[2]
    along = np.hypot(alpha_u * np.cos(phi), alpha_v * np.sin(phi))
    stretched = np.clip(u[3] * 2 % 1, 1e-3, 1 - 1e-9)
    even = np.radians(89.9) * (u[3] * 2 % 1)
    theta = np.where(u[3] < 0.5, np.arctan(np.sqrt(1 / stretched**2 - 1) / along), even)
    return np.maximum(np.cos(theta), 1e-4), phi, alpha_u, alpha_v


def importance(cos: np.ndarray, phi: np.ndarray, alpha_u: np.ndarray, alpha_v: np.ndarray) -> np.ndarray:
    """Return how much an error counts."""
    low, high = np.minimum(alpha_u, alpha_v), np.maximum(alpha_u, alpha_v)
    precise = (low >= PRECISE[0]) & (high <= PRECISE[1]) & (high <= 9 * low) & (cos >= np.cos(np.radians(86)))
    return np.where(precise, 16, np.where((high < 2) & (high <= 16 * low), 3, 1.0))


# --- The polynomials ------------------------------------------------------------------------------------------------


def compressed(alpha: np.ndarray) -> np.ndarray:
    return alpha / np.sqrt(1 + alpha * alpha)


def variables(cos: np.ndarray, phi: np.ndarray, alpha_u: np.ndarray, alpha_v: np.ndarray) -> list[np.ndarray]:
    along = np.hypot(alpha_u * np.cos(phi), alpha_v * np.sin(phi))
    m = 1 - cos / np.sqrt(cos * cos + along**2 * (1 - cos * cos))
    return [m, compressed(along), *variables_of_roughness(alpha_u, alpha_v)]


def variables_of_roughness(alpha_u: np.ndarray, alpha_v: np.ndarray) -> list[np.ndarray]:
    u, v = compressed(alpha_u), compressed(alpha_v)
    return [(u + v) / 2, (u - v) ** 2]


def variables_of_means(alpha_u: np.ndarray, alpha_v: np.ndarray) -> list[np.ndarray]:
    mean, difference2 = variables_of_roughness(alpha_u, alpha_v)
    return [np.sqrt(mean), difference2 / mean**2]


def exponents(degree: float, steps: tuple[float, ...], isotropic: bool) -> list[tuple[int, ...]]:
    """Return those of a polynomial's terms. At the normal there is no roughness along the direction."""
    every = itertools.product(*(range(int(degree / step) + 1) for step in steps))
    few = [e for e in every if np.dot(e, steps) <= degree and (len(e) == 2 or e[0] or not e[1])]
    return [e for e in few if not (isotropic and (e[-1] or (len(e) == 4 and e[1])))]


def terms(at: list[np.ndarray], powers: list[tuple[int, ...]]) -> np.ndarray:
    """Return the products of powers, one for each term on the last axis."""
    of_each = zip(at, np.transpose(powers), strict=True)
    return np.prod([(x[:, None] ** np.arange(max(e) + 1))[:, e] for x, e in of_each], axis=0)


def fitted(
    name: str, at: list[np.ndarray], values: np.ndarray, weight: np.ndarray, isotropic: bool, rounds: int
) -> np.ndarray:
    """Return the coefficients of the polynomial with the least weighted squares; with more rounds, of those that make
    the largest error least, which Lawson's algorithm approaches by giving large errors more weight."""
    powers = exponents(*DEGREES[name], isotropic)
    if name in (*SHAPES, "blinn"):  # smooth surfaces lose nothing
        powers = [e for e in powers if e[0] or sum(e) > 1]
    basis, emphasis = terms(at, powers), np.ones(len(values))
    best, least = np.zeros(len(powers)), np.inf
    for _ in range(rounds):
        scale = weight * np.sqrt(emphasis)
        k = np.linalg.lstsq(basis * scale[:, None], values * scale, rcond=1e-13)[0]
        error = weight * abs(basis @ k - values)
        if error.max() < least:
            best, least = k, error.max()
        emphasis *= 0.3 + 0.7 * error / error.max()
        emphasis /= emphasis.mean()
    dense = np.zeros([max(each) + 1 for each in zip(*powers, strict=True)])
    dense[tuple(np.transpose(powers))] = best
    return dense


def evaluated(k: np.ndarray, at: list[np.ndarray]) -> np.ndarray:
    powers = [tuple(e) for e in np.argwhere(k)]
    return terms(at, powers) @ k[tuple(np.transpose(powers))]


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
        "lost": left[0],
        "between": np.stack(between) / left[1],
    }


def _moments(cos: mi.Float) -> mi.Vector2f:
    m = 1 - cos
    schlick = dr.square(dr.square(m)) * m
    return mi.Vector2f(schlick, cos * m * schlick)


def _means(values: mi.Float, count: int) -> np.ndarray:
    return dr.block_sum(values, count).numpy().astype(np.float64) / count


# --- What becomes of light ------------------------------------------------------------------------------------------


def walked(shape: str, count: int, isotropic: bool) -> dict[str, np.ndarray]:
    """Return the polynomials of what :func:`walks` finds."""
    at = settings(WALKED)
    parts = [walks(shape, *(each[k : k + 256] for each in at), count) for k in range(0, WALKED, 256)]
    found = {name: np.concatenate([part[name] for part in parts], axis=-1) for name in parts[0]}
    found |= {"schlick between": found["between"][0], "dip between": found.pop("between")[1]}
    # Weigh by what light there is: its standard deviation falls with the root of that, and less counts less.
    weight = np.minimum(importance(*at), 1.2) * np.sqrt(found.pop("lost"))
    polynomials = {}
    for name, values in found.items():
        seen = np.isfinite(values) & (weight > 1e-2)
        here = [x[seen] for x in variables(*at)]
        kind = name.split()[0] if name.split()[0] in DEGREES else "second"
        polynomials[name] = fitted(kind, here, values[seen], weight[seen], False, 1)
    return polynomials


def first(shape: str, correlated: bool) -> np.ndarray:
    """Return the polynomial of 1 - E."""
    isotropic = shape == "blinn"
    at = settings(SETTINGS, isotropic)
    if isotropic:
        values = np.array([blinn_lost(correlated, float(c), float(a)) for c, a in zip(at[0], at[2], strict=True)])
    else:
        values = np.array([lost(shape, correlated, *map(float, each)) for each in zip(*at, strict=True)])
    # Where Blinn's facets reflect more than they get, nothing is added. Turquin's scale divides by what is not lost.
    weight = np.where(values < -0.02, 0.1, 1) * importance(*at) / np.sqrt(np.maximum(1 - values, 0.05))
    return fitted(shape, variables(*at), np.maximum(values, -1), weight, isotropic, 24)


def means(k: dict[str, np.ndarray], isotropic: bool) -> dict[str, np.ndarray]:
    """Return polynomials of means over the hemisphere: of 1 - E, over (x(αu)² + x(αv)²)/2."""
    alpha, phi = np.geomspace(SMOOTHEST, 1 if isotropic else ROUGHEST, 24), np.pi / 2 * (np.arange(8) + 0.5) / 8
    pairs = np.array([(a, b) for a in alpha for b in alpha if (a == b if isotropic else b <= a <= 50 * b)]).T
    found = []
    for a, b in pairs.T:
        at = [x.ravel() for x in np.broadcast_arrays(NODES[:, None], phi, a, b)]
        weight = (WEIGHTS[:, None] * 2 * NODES[:, None] / len(phi) + 0 * phi).ravel()
        here = variables(*at)
        said = {name: evaluated(each, here) for name, each in k.items()}
        escaping = weight * np.clip(said["lost"], 0, 1)
        left = escaping * np.clip(said["left"], 0, 1)
        found.append({
            "lost": escaping.sum() / np.mean(compressed(np.array([a, b])) ** 2),
            "second": escaping @ np.clip(said["second"], 0, 1) / escaping.sum(),
            "third": left @ np.clip(said["third"], 0, 1) / left.sum(),
            "schlick": left @ said["schlick between"] / left.sum(),
            "dip": left @ said["dip between"] / left.sum(),
        })  # fmt: skip
    at, result = variables_of_means(*pairs), {}
    for name in found[0]:
        values = np.array([each[name] for each in found])
        weight = np.where((pairs[1] > 0.02) & (pairs[0] < 1.5) & (pairs[0] < 9 * pairs[1]), 8, 1) / abs(values)
        result[f"mean-{name}"] = fitted("mean", at, values, weight, isotropic, 24)
    return result


def made(count: int) -> dict[str, np.ndarray]:
    """Return all polynomials, of ``count`` walks for each setting."""
    arrays = {}
    walk = {shape: walked(shape, count, False) for shape in SHAPES}
    for shape in (*SHAPES, "blinn"):
        for correlated in (False, True):
            isotropic = shape == "blinn"
            k = {**walk["beckmann" if isotropic else shape], "lost": first(shape, correlated)}
            k |= means(k, isotropic)
            name = f"{shape}-{'correlated' if correlated else 'separable'}"
            arrays |= {f"{name}:{key}": k[key] for key in k if " " not in key and key not in ("left", "third")}
    return {name: values.astype(np.float32) for name, values in arrays.items()}


if __name__ == "__main__":
    checked = parser(__doc__).parse_args().check
    mi.set_variant("llvm_ad_rgb")
    polynomials = made(WALKS >> 4 if checked else WALKS)
    if not checked:
        np.savez_compressed(FILE, **polynomials)
        print(f"{FILE}: {FILE.stat().st_size} bytes")
        sys.exit()
    # By their values at the settings, as coefficients may differ where the sum does not.
    at, errors = variables(*settings(WALKED)), {}
    with np.load(FILE) as kept:
        for name, k in polynomials.items():
            here = at if k.ndim == 4 else at[2:]
            errors[name] = float(abs(evaluated(k, here) - evaluated(kept[name], here)).mean())
    print(*(f"{name}: {error:.4f}" for name, error in errors.items()), sep="\n")
    sys.exit(max(errors.values()) > 0.01)
