"""The parts of a microfacet model: distributions (D), shadowing (G), Fresnel reflectance (F), and how their product
is sampled."""

from .distributions import Distribution, Isotropic
from .facet import Facet
from .fresnel import Fresnel
from .sampling import Sampler
from .shadowing import Shadowing

__all__ = ["Distribution", "Facet", "Fresnel", "Isotropic", "Sampler", "Shadowing"]
