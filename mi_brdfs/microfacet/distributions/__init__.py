"""Facet distributions D.

A distribution knows its value ``D(facet)``, with ∫ D cosθ_h dω_h = 1 unless it says otherwise, and, for the sampler of
:mod:`mi_brdfs.microfacet.sampling`, the half-vector density q that goes with it. q is elliptical: in the azimuth ψ of
the stretched slope (h_x/h_z, h_y/h_z) = r (αu cosψ, αv sinψ) it is uniform, and on a line of azimuth ψ it has a
cumulative distribution in t = tan²θ_h, which may depend on ``g`` = 1/((αu cosψ)² + (αv sinψ)²).
"""

from ..terms import Distribution, Isotropic
from .abc import ABC
from .classical import GGX, AshikhminShirleyNormals, Beckmann, Blinn
from .epd import EPD
from .gtr import GTR, Berry
from .hemi_epd import HemiEPD

__all__ = [
    "ABC",
    "EPD",
    "GGX",
    "GTR",
    "AshikhminShirleyNormals",
    "Beckmann",
    "Berry",
    "Blinn",
    "Distribution",
    "HemiEPD",
    "Isotropic",
]
