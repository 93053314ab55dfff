"""The choice of a sampler for a distribution, a shadowing and a Fresnel term: the same for every model that combines
them."""

from __future__ import annotations

from .distributions import GGX, AshikhminShirleyNormals, Distribution
from .forward import WithForwardShare
from .fresnel import Dielectric, Fresnel, Schlick
from .grazing import AntitheticImplicitNormals, AntitheticNormalsTowardViewer, AntitheticSteepNormals
from .sampling import AntitheticNormals, Sampler
from .shadowing import Implicit, SchlickSmith, Shadowing, SmithGGX
from .visible import AntitheticVisibleNormals, BoundedVisibleNormals


def sampler_of(distribution: Distribution, shadowing: Shadowing, fresnel: Fresnel) -> Sampler:
    """Return the sampler for a lobe of these terms, as measured by tests/calibration/samplers.py."""
    sampler = _sampler_of_facets(distribution, shadowing, fresnel)
    return WithForwardShare(sampler) if isinstance(fresnel, Dielectric) else sampler


def _sampler_of_facets(distribution: Distribution, shadowing: Shadowing, fresnel: Fresnel) -> Sampler:
    rises = isinstance(fresnel, Dielectric | Schlick)  # towards grazing angles, from a few percent to one
    if isinstance(distribution, GGX) and isinstance(shadowing, SmithGGX):
        if not shadowing.correlated:
            # A pair takes longer, which is worth it only where the reflectance rises.
            return AntitheticVisibleNormals() if rises else BoundedVisibleNormals()
        if not rises:
            return AntitheticVisibleNormals()
    if isinstance(distribution, GGX) and isinstance(shadowing, SchlickSmith):
        return AntitheticVisibleNormals()
    # Those normals are drawn without a cosine, and so steep ones more often.
    favours_steep = shadowing.favours_steep and not isinstance(distribution, AshikhminShirleyNormals)
    if shadowing.lean:
        leaning = AntitheticImplicitNormals if isinstance(shadowing, Implicit) else AntitheticNormalsTowardViewer
        return leaning(steep=distribution.long_tailed or favours_steep)
    return AntitheticSteepNormals() if favours_steep else AntitheticNormals()
