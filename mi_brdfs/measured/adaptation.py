"""Adaptive coordinates for a BRDF that is given as a function."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from ..probe.arrays import luminance
from .adaptive import on_phi, on_theta
from .arrays import NUMPY, stacked
from .coordinates import TWO_PI, HalfDifference, polar_angle
from .grid import usable
from .source import Source, pairs
from .warp import Map

COLUMNS, ROWS = 128, 64
"""The nodes over θ and over φ of the distribution of normals."""
LAST = np.radians(89.5)
"""The angle at which the value at the horizon is taken."""
NORMALS_SHARE = 0.2
"""The share of u1 that follows the visible normals; the rest is even in √θ. Narrow lobes get enough nodes by it, and
wide ones do not lose theirs; between 0.1 and 0.3 errors are the same."""
COSINE_SHARE = 0.05
"""The share of the cosine in the distribution of normals: it is divided by where nothing is scattered, too."""
ITERATIONS = 10


def adapted(source: Source, phi_i: np.ndarray, theta_i: np.ndarray, rows: int) -> tuple[np.ndarray, ...]:
    """Return the maps ``(ndf, sigma, vndf)`` of :class:`~mi_brdfs.measured.adaptive.Adaptive`: the first two take the
    highlights out of f, so that a table of f cosθo 4 σ/D is smooth, and ``vndf`` spends its nodes on directions above
    the horizon alone.

    ``vndf`` need not be that of the visible normals: any density will do that is the same for sampling and inverting.
    Here u2 is the azimuth of the half vector, and the end of u1 is the horizon, where 2 (wi·h) h - wi has no height:
    θh = atan2(cosθi, -sinθi cos(φh - φi))/2. The visible normals alone would spend many nodes below the horizon, and so
    few about the normal that a Lambertian table is off by 10 % of its peak.
    """
    ndf, sigma = normals(source)
    x, y = np.meshgrid(np.linspace(0, 1, COLUMNS), np.linspace(0, 1, rows))
    theta, phi = np.square(x) * (np.pi / 2), (2 * y - 1) * np.pi
    density = Map(ndf).eval(x, y) * x * np.sin(theta)
    vndf = np.empty((len(phi_i), len(theta_i), rows, COLUMNS), dtype=np.float32)
    for p, azimuth in enumerate(phi_i):
        cos_phi = np.cos(phi - azimuth if len(phi_i) > 2 else phi)
        for t, polar in enumerate(theta_i):
            cos, sin = np.cos(polar), np.sin(polar)
            horizon = np.sqrt(np.arctan2(cos, -sin * cos_phi) / np.pi)
            above = (x < horizon + 1 / (COLUMNS - 1)).astype(np.float64)
            seen = above * density * np.maximum(cos * np.cos(theta) + sin * np.sin(theta) * cos_phi, 0)
            even, total = above / area(above), area(seen)
            followed = np.divide(seen, total, out=even.copy(), where=total > 0)
            vndf[p, t] = NORMALS_SHARE * followed + (1 - NORMALS_SHARE) * even
    return ndf, sigma, vndf


def normals(source: Source) -> tuple[np.ndarray, np.ndarray]:
    """Return ``(ndf, sigma)``, a distribution of normals D, and the projected areas of those seen from a direction,
    σ(w) = ∫ D(h) max(w·h, 0) dh.

    Without shadowing f cosθo = D(h) F/(4 σ(wi)). D is thus the mean of 4 f cosθo σ(wi) over pairs of directions with
    the half vector h, in which σ comes from D by iteration. (From h itself alone, the eigenvector of J. Dupuy et al.,
    Extracting microfacet-based BRDF parameters from arbitrary materials with power iterations, CGF 34(4), 2015,
    doi:10.1111/cgf.12675, would follow; but few goniometers measure what is scattered straight back.)
    """
    u = np.linspace(0, 1, COLUMNS)
    theta = np.square(u) * (np.pi / 2)
    phi = (np.arange(ROWS) * (2 / ROWS) - 1) * np.pi if source.anisotropic else np.zeros(1)
    wi, wo = around(*np.meshgrid(np.minimum(theta, LAST), phi))
    above = (wi.z > 0) & (wo.z > 0)
    weight = np.where(above, wi.z * wo.z, 0)
    weight /= weight.sum(axis=0)
    back = np.zeros(above.shape)
    back[above] = 4 * brightness(source.evaluate(stacked(wi)[above], stacked(wo)[above]))
    back *= weight * wo.z
    place = on_theta(polar_angle(wi), NUMPY), on_phi(np.arctan2(wi.y, wi.x), NUMPY)

    turn = np.arange(ROWS) * (TWO_PI / ROWS)
    cos, sin = np.cos(theta)[:, None, None], np.sin(theta)[:, None, None]
    seen = np.maximum(cos * cos[:, 0] + sin * sin[:, 0] * np.cos(turn), 0)
    solid_angle = np.sin(theta) * np.pi * u * (TWO_PI / ROWS / (COLUMNS - 1))
    kernel = np.fft.rfft(seen * solid_angle[:, None])

    def projected(density: np.ndarray) -> np.ndarray:
        waves = np.fft.rfft(np.broadcast_to(density, (ROWS, COLUMNS)), axis=0)
        return np.fft.irfft(np.einsum("thf,fh->ft", kernel, waves), ROWS, axis=0)[: len(phi)]

    cosine = np.broadcast_to(np.cos(theta) / np.pi, (len(phi), COLUMNS))
    ndf = cosine
    for _ in range(ITERATIONS):
        found = np.sum(back * Map(closed(projected(ndf))).eval(*place), axis=0)
        if not np.any(found > 0):
            break
        ndf = found / projected(found)[:, 0].mean()
    ndf = (1 - COSINE_SHARE) * ndf + COSINE_SHARE * cosine
    return closed(ndf), closed(projected(ndf))


def around(theta_h: np.ndarray, phi_h: np.ndarray) -> tuple[SimpleNamespace, SimpleNamespace]:
    """Return pairs of directions with half vectors, along a new first axis."""
    theta_d, phi_d = np.meshgrid(np.radians([20, 40, 60]), np.arange(8) * (TWO_PI / 8))
    theta_d, phi_d = (np.append(0, d)[:, None, None] for d in (theta_d, phi_d))
    return HalfDifference(anisotropic=True).directions(np.sqrt(theta_h * (2 / np.pi)), theta_d, phi_d, phi_h)


def closed(rows: np.ndarray) -> np.ndarray:
    """Return a map with its first row once more at the end, and nowhere 0: it is divided by."""
    return np.maximum(np.concatenate([rows, rows[:1]]), 1e-6).astype(np.float32)


def turned(source: Source) -> float:
    """Return over which angle φi is to be tabulated: 2π, or π or π/2 where turning or mirroring both directions changes
    nothing, or 0 if isotropic."""
    if not source.anisotropic:
        return 0.0
    wi, wo = pairs(1024)
    f = source.evaluate(wi, wo)
    unchanged = [
        np.allclose(source.evaluate(wi * signs, wo * signs), f, rtol=2e-3, atol=1e-3 * f.mean())
        for signs in ([-1, -1, 1], [-1, 1, 1])
    ]
    if not unchanged[0]:
        return TWO_PI
    return np.pi / 2 if unchanged[1] else np.pi


def brightness(values: np.ndarray) -> np.ndarray:
    """Return the luminance of linear sRGB, the mean of other channels, and 0 where that is negative or missing."""
    return usable(luminance(values))


def area(values: np.ndarray) -> np.ndarray:
    """Return the integrals over [0, 1] of the rows."""
    return (values.sum(axis=-1, keepdims=True) - (values[:, :1] + values[:, -1:]) / 2) / (values.shape[-1] - 1)
