"""MERL's tables, written without the package, and where pairs of directions lie in them."""

from pathlib import Path

import numpy as np

SCALE = np.array([1, 1.15, 1.66]) / 1500


def centres(dimensions, turn=np.pi):
    """θh, θd and φd in the middle of the cells."""
    h, d, p = ((np.arange(n) + 0.5) / n for n in dimensions)
    return np.meshgrid(h**2 * np.pi / 2, d * np.pi / 2, p * turn, indexing="ij")


def lowest(theta_h, theta_d, phi_d):
    """The smaller one of the cosines of wi and wo: the half vector turned by θh has d at (θd, φd), and the other
    direction opposite."""
    return np.cos(theta_h) * np.cos(theta_d) - abs(np.sin(theta_h) * np.sin(theta_d) * np.cos(phi_d))


def write(path, f, dimensions) -> Path:
    """Write f, which has the shape (*dimensions, 3) or less."""
    planes = np.moveaxis(np.broadcast_to(f, (*dimensions, 3)) / SCALE, -1, 0)
    path.write_bytes(np.array(dimensions, "<i4").tobytes() + planes.astype("<f8").tobytes())
    return path


def angles(wi, wo):
    """θh, θd and φd in [-π, π] after Rusinkiewicz, by the two turns that take the half vector to the normal."""
    h = wi + wo
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    theta, phi = np.arccos(h[:, 2]), np.arctan2(h[:, 1], h[:, 0])
    x, y = wi[:, 0] * np.cos(phi) + wi[:, 1] * np.sin(phi), wi[:, 1] * np.cos(phi) - wi[:, 0] * np.sin(phi)
    x, z = x * np.cos(theta) - wi[:, 2] * np.sin(theta), x * np.sin(theta) + wi[:, 2] * np.cos(theta)
    return theta, np.arccos(np.clip(z, -1, 1)), np.arctan2(y, x)
