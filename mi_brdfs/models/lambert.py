from __future__ import annotations

from ..lobes import LambertLobe, Lobe
from ..model import Model, Values
from ..parameters import Reflectance


class Lambert(Model):
    """Lambert's diffuse reflection (1760).

    J. H. Lambert, Photometria sive de mensura et gradibus luminis, colorum et umbrae, 1760.

        f = ρ/π

    The surface looks equally bright from all directions. Same as Mitsuba's ``diffuse``.

    Reciprocal. Energy-conserving: the albedo is ρ. Sampled exactly (cosine-weighted): every weight is ρ. One-sided;
    nest it in ``twosided`` for both sides. Depolarises.

    Example
    -------
    {"type": "lambert", "reflectance": {"type": "rgb", "value": [0.2, 0.5, 0.8]}}
    """

    family = "diffuse"

    reflectance = Reflectance(0.5, "albedo ρ")

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        return (LambertLobe(p.reflectance),)
