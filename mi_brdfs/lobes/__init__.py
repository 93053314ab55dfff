"""The lobes of BRDFs, which can be evaluated, sampled and mixed."""

from .diffuse import LambertLobe, over_diffuse
from .facets import facet_lobes
from .lobe import Lobe, Mixture, WeightedLobe
from .microfacet import MicrofacetLobe
from .power import PowerLobe, PowerResponseLobe

__all__ = [
    "LambertLobe",
    "Lobe",
    "MicrofacetLobe",
    "Mixture",
    "PowerLobe",
    "PowerResponseLobe",
    "WeightedLobe",
    "facet_lobes",
    "over_diffuse",
]
