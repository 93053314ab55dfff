"""What can be evaluated, sampled and mixed."""

from .diffuse import LambertLobe, over_diffuse
from .lobe import Lobe
from .microfacet import DimmedLobe, MicrofacetLobe, TypicalFacetLobe
from .mirror import PowerLobe, PowerResponseLobe
from .mixture import Mixture

__all__ = [
    "DimmedLobe",
    "LambertLobe",
    "Lobe",
    "MicrofacetLobe",
    "Mixture",
    "PowerLobe",
    "PowerResponseLobe",
    "TypicalFacetLobe",
    "over_diffuse",
]
