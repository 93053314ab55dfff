"""Random walk on a Smith microsurface of reflecting facets: a Monte Carlo reference for multiple scattering.

Source: E. Heitz, J. Hanika, E. d'Eon, C. Dachsbacher, "Multiple-scattering microfacet BSDFs with the Smith model",
ACM Transactions on Graphics 35(4), 2016, doi:10.1145/2897824.2925943.

A ray enters from above, collides with the surface at a height drawn from the Smith model, is reflected by a normal
drawn from those it sees, and goes on until it leaves. Heights enter only through their cumulative distribution C1, as
a ray that starts at height h leaves with probability C1(h)^Lambda(direction); the walk carries log C1, so the
result holds for any distribution of heights. Vectors are arrays of shape (3, n), z up; all angles are met in
the stretched space where the roughness is 1: (alpha_u x, alpha_v y, z).

The visible normals of GGX are drawn with the spherical caps of J. Dupuy and A. Benyoub, "Sampling visible GGX normals
with spherical caps", 2023, doi:10.1111/cgf.14867, those of Beckmann by rejection in the space of slopes.
"""

import math

import numpy as np
from scipy.special import erfc

TINY = 1e-12  # least horizontal extent of a stretched direction; keeps cotangents finite


def _stretch(w, alpha_u, alpha_v):
    """Return the stretched x, y and z of the directions `w` (not normalized), and the length of (x, y)."""
    x, y, z = alpha_u * w[0], alpha_v * w[1], w[2]
    return x, y, z, np.maximum(np.hypot(x, y), TINY)


def smith_lambda(distribution, alpha_u, alpha_v, w):
    """Return Smith's Lambda, signed, for directions `w` (3, n): Lambda(-w) = -1 - Lambda(w)."""
    z, r = _stretch(w, alpha_u, alpha_v)[2:]
    height = np.abs(z)
    with np.errstate(divide="ignore", over="ignore"):  # a horizontal ray has an infinite Lambda
        if distribution == "ggx":
            # (sqrt(1 + (r/z)^2) - 1) / 2 without its cancellation.
            upward = r * r / (2 * height * (height + np.hypot(height, r)))
        else:
            a = height / r
            upward = np.maximum(np.exp(-a * a) / math.sqrt(math.pi) - a * erfc(a), 0) / (2 * a)
    return np.where(z > 0, upward, -1 - upward)


def _ggx_normals(x, y, z, r, rng):
    """Draw stretched GGX normals (not normalized) seen from stretched directions."""
    # Mirrored by a unit sphere, w goes into directions o of uniform density; the normal w + o of a facet has z > 0
    # where o_z > -w_z. This holds for w_z < 0 as well. 1 + w_z and the sum w_z + o_z are formed without cancellation.
    length = np.hypot(r, z)
    x, y, z, r = x / length, y / length, z / length, r / length
    cap = np.where(z > 0, 1 + z, r * r / (1 + np.abs(z)))
    u, phi = rng.random(z.size), 2 * math.pi * rng.random(z.size)
    normal_z = (1 - u) * cap
    sine = np.sqrt(u * cap * (1 - z + normal_z))  # (1 - o_z)(1 + o_z), o_z = normal_z - w_z
    return np.stack((x + sine * np.cos(phi), y + sine * np.sin(phi), normal_z))


def _tilted_gaussian(a, rng):
    """Draw t from the density proportional to (a + t) exp(-t^2) on t > -a, by rejection."""
    t = np.empty_like(a)
    todo = np.arange(a.size)
    while todo.size:
        c = a[todo]
        choice, u = rng.random((2, c.size))
        rayleigh = np.sqrt(rng.standard_exponential(c.size))  # density 2 v exp(-v^2)
        # a >= 0: propose a exp(-t^2) on the whole line plus t exp(-t^2) on t > 0; only t < 0 can be rejected.
        gaussian = choice * (c * math.sqrt(math.pi) + 0.5) < c * math.sqrt(math.pi)
        above = np.where(gaussian, math.sqrt(0.5) * rng.standard_normal(c.size), rayleigh)
        # a < 0: with v = a + t the density is v exp(-v^2) exp(2 a v); propose it without the one or the other factor.
        steep = c < -0.75
        v = np.where(steep, rng.standard_gamma(2, c.size) / (2 * np.maximum(-c, 0.75)), rayleigh)
        chance = np.where(
            c < 0,
            np.exp(np.where(steep, -v * v, 2 * np.minimum(c, 0) * v)),
            1 + np.minimum(above, 0) / np.maximum(c, TINY),
        )
        t[todo] = np.where(c < 0, v - c, above)
        todo = todo[u >= chance]
    return t


def _beckmann_normals(x, y, z, r, rng):
    """Draw stretched Beckmann normals (not normalized) seen from stretched directions."""
    # A normal (t, s, 1), with t along the azimuth of w, has the density exp(-t^2 - s^2) / pi and is seen under
    # z + r t: s is plainly Gaussian, and t has the density of _tilted_gaussian with the cotangent of w.
    t = _tilted_gaussian(z / r, rng)
    s = math.sqrt(0.5) * rng.standard_normal(z.size)
    azimuth = np.arctan2(y, x)
    cos_phi, sin_phi = np.cos(azimuth), np.sin(azimuth)
    return np.stack((t * cos_phi - s * sin_phi, t * sin_phi + s * cos_phi, np.ones_like(z)))


def visible_normals(distribution, alpha_u, alpha_v, w, rng):
    """Draw a normal from those visible from each of the directions `w` (3, n), which may lie below the horizon."""
    draw = _ggx_normals if distribution == "ggx" else _beckmann_normals
    m = draw(*_stretch(w, alpha_u, alpha_v), rng) * np.array([[alpha_u], [alpha_v], [1.0]])
    return m / np.sqrt(np.sum(m * m, axis=0))


def walk(distribution, alpha_u, alpha_v, wi, fresnel, count, rng, orders=20):
    """Return the energies that leave after 1, 2, ..., `orders` reflections, and their standard errors.

    `wi` is the unit vector towards the light, above the surface; `fresnel` maps cosines (n,) to reflectances (n,) or
    (n, channels). Both results have the shape (orders,) or (orders, channels).
    """
    if distribution not in ("ggx", "beckmann"):
        raise ValueError(f"unknown distribution: {distribution!r}")
    ray = np.repeat(-np.asarray(wi, float)[:, None], count, axis=1)
    channels = np.shape(fresnel(np.ones(1)))[1:]
    weight = np.ones((count, *channels))
    total, squares = np.zeros((2, orders, *channels))
    # The first collision: all rays start above the surface, at log C1 = 0, and go down.
    log_c1 = rng.standard_exponential(count) / smith_lambda(distribution, alpha_u, alpha_v, ray)
    for order in range(orders):
        normal = visible_normals(distribution, alpha_u, alpha_v, -ray, rng)
        cosine = np.clip(-np.sum(ray * normal, axis=0), 0, 1)
        ray = ray + 2 * cosine * normal
        weight = weight * fresnel(cosine)
        # The next collision: C1' = C1 (1 - U)^(-1/Lambda), and -log(1 - U) is exponential. C1' >= 1 is no collision.
        with np.errstate(divide="ignore", over="ignore"):  # Lambda = 0: the ray leaves
            log_c1 = log_c1 + rng.standard_exponential(log_c1.size) / smith_lambda(distribution, alpha_u, alpha_v, ray)
        inside = ~(log_c1 >= 0)  # a NaN would stay inside and show as lost energy
        total[order] = weight[~inside].sum(axis=0)
        squares[order] = (weight[~inside] ** 2).sum(axis=0)
        ray, weight, log_c1 = ray[:, inside], weight[inside], log_c1[inside]
    mean = total / count
    return mean, np.sqrt(np.maximum(squares / count - mean * mean, 0) / (count - 1))
