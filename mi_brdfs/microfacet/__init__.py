"""The parts of a microfacet model: distributions (D), shadowing terms (G), Fresnel reflectances (F), and the samplers
of their product."""

from .distributions import Distribution, Isotropic
from .facet import Facet
from .fresnel import Fresnel
from .shadowing import Shadowing

__all__ = ["Distribution", "Facet", "Fresnel", "Isotropic", "Shadowing"]
