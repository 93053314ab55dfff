from __future__ import annotations

import drjit as dr

from ..lobes import LambertLobe, Lobe, PowerLobe, PowerResponseLobe
from ..model import Model, Values
from ..parameters import Choice, Number, Reflectance


class Phong(Model):
    """Phong's reflection (1975), in the normalised form of Lafortune and Willems (1994).

    B. T. Phong, Illumination for computer generated pictures, Communications of the ACM 18(6), 1975,
    doi:10.1145/360825.360839. E. P. Lafortune and Y. D. Willems, Using the modified Phong reflectance model for
    physically based rendering, Report CW 197, K. U. Leuven, 1994.

        f = ρd/π + ρs (n+2)/(2π) max(0, r·wo)ⁿ,    r = 2 (n·wi) n - wi

    with r the mirror direction. ``normalization`` chooses the specular term:

    * energy: as above. The lobe's albedo is ρs at normal incidence and falls towards grazing angles, like cosθ for
      narrow lobes, so ρd + ρs <= 1 conserves energy.
    * none: ρs max(0, r·wo)ⁿ. Its albedo is 2π ρs/(n+2) at normal incidence: it gains energy for n < 4.28.
    * original: f cosθ_o = ρs max(0, r·wo)ⁿ/π, the formula of 1975, where the term is the whole response to a light and
      π belongs to the light. As a BRDF it is neither reciprocal nor bounded at grazing angles; its albedo is at most
      2ρs/(n+1).

    Reciprocal, except for ``original``. Energy-conserving for ``energy`` with ρd + ρs <= 1. Same as ``phong`` of
    Mitsuba 0.6. One-sided. Depolarises. The lobe is zero from 90° away from r, even for n = 0, which is therefore not
    Lambert's model.

    Sampling: nearly in proportion to f cosθ_o (mi_brdfs.lobes.PowerLobe); no sample falls below the horizon.

    Example
    -------
    {"type": "phong", "diffuse_reflectance": {"type": "rgb", "value": [0.1, 0.2, 0.4]}, "exponent": 60}
    """

    family = "cosine lobes"

    diffuse_reflectance = Reflectance(0.5, "albedo ρd of the diffuse lobe", role="diffuse")
    specular_reflectance = Reflectance(0.2, "scale ρs of the specular lobe", role="specular")
    exponent = Number(30, (0, 1e6), "exponent n: the higher, the narrower the highlight")
    normalization = Choice(("energy", "none", "original"), "scale of the specular lobe")

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        diffuse, n = LambertLobe(p.diffuse_reflectance), p.exponent
        if self.normalization == "original":
            return diffuse, PowerResponseLobe(p.specular_reflectance, n, dr.inv_pi)
        scale = (n + 2) * dr.inv_two_pi if self.normalization == "energy" else 1
        return diffuse, PowerLobe(p.specular_reflectance, n, scale)
