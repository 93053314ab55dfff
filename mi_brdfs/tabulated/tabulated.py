"""The plugin that renders a measured file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import mitsuba as mi
import numpy as np

from ..lobes import Lobe
from ..math import Spectrum
from ..model import Model, Section, Values
from ..parameters import Choice, Colour, File, Flag, Rotation

if TYPE_CHECKING:
    from .tables import Tables


class Tabulated(Model):
    """A measured BRDF from a file.

    Reads MERL's ``.binary`` and every other format that ``mi-brdfs measured -h`` lists; which one, it finds from what
    the file contains. A CSV of your own begins with a header such as ``theta_i_deg,theta_o_deg,delta_phi_deg,f``, in
    1/sr, with delta_phi = 180° on the side of the mirror direction. A relative name is looked for where Mitsuba looks
    for textures: beside the scene.

        f(wi, wo) = s T(wi, wo)

    with ``scale`` s and the table T.

    ``trilinear`` interpolates linearly between the neighbouring nodes of the file's own grid: half and difference
    angles for MERL, angles about the mirror direction for goniometers, adaptive coordinates for RGL; four-dimensional
    where the file is anisotropic. ``nearest`` takes the nearest node's value: MERL's own look-up. Negative values count
    as 0, except for the channels of RGL's colours outside sRGB, and so do missing ones; but ``trilinear`` puts the mean
    of the neighbours that were measured in their place, where there are such. What lies outside the measured range has
    the value at its border with ``hold``, and is 0 with ``zero``. What a file calls the incident direction is wi, as in
    Mitsuba's ``measured``. Files of f cosθ_o are divided by the cosine; ``quantity`` is for those that do not state
    what they hold: ALTA's without #PARAM_OUT must be told, others are ``f`` by default.

    Linear sRGB values are rgb. In spectral variants they weigh three spectra that sum to 1, so that white stays white.
    Values at several wavelengths are interpolated between them in spectral variants; rgb variants show them under
    daylight (D65), and clip colours outside sRGB. A single wavelength is grey. Scattered samples become a grid of half
    and difference angles, of means of the nearest samples with positive weights.

    The energy is the file's: nothing keeps a measurement from reflecting more than it receives. Reciprocal where the
    format is (MERL with half a turn of φd), and of scattered samples, which count for both orders of their directions;
    else as good as the measurement. One-sided. Depolarises.

    A file that several BSDFs name is in memory once. With ``differentiable`` a BSDF has its own copy, and
    ``mitsuba.traverse`` shows it as ``values``: a tensor with the file's axes, and the channels last, in [0, ∞) unless
    the file's may be negative. Directions are then drawn as the file says, whatever the values become.

    Sampling: from a table over the half vector for 58 angles θi, in proportion to f cosθ_o at its nodes, by Mitsuba's
    ``MarginalContinuous2D``, and 2 % by the cosine (mi_brdfs.tabulated.proposal).

    W. Matusik, H. Pfister, M. Brand and L. McMillan, A data-driven reflectance model, ACM Transactions on Graphics
    22(3), 2003, doi:10.1145/882262.882343.

    Example
    -------
    {"type": "tabulated", "filename": "alum-bronze.binary"}
    """

    plugins = "tabulated", "merl"
    data = True

    filename = File("the measured file")
    scale = Colour(1, (0, np.inf), "factor on all values")
    interpolation = Choice(("trilinear", "nearest"), "between the nodes of the file's grid")
    extrapolate = Choice(("hold", "zero"), "beyond the measured range: the value at its border, or nothing")
    quantity = Choice(("stated", "f", "f cos"), "what a file holds that does not state it: f, or f cosθ_o")
    differentiable = Flag(False, "give this BSDF a table of its own, with derivatives, as the parameter values")
    rotation = Rotation()

    def __init__(self, props: mi.Properties) -> None:
        from .tables import Tables  # on first use: the readers take time

        super().__init__(props)
        chosen = self.parameters.chosen
        shared = not chosen["differentiable"]
        words = chosen["interpolation"], chosen["extrapolate"], chosen["quantity"]
        self.tables = Tables.of(chosen["filename"], *words, shared)
        self.captured, self.signed = self.tables.captured, self.tables.signed
        if not shared:
            self.arrays = {"values": self.tables.f.values}
            self.ranges = self.ranges | {"values": self.tables.limits}

    @classmethod
    def sections(cls) -> list[Section]:
        return super(Model, cls).sections()  # a file has no largest albedo but its own

    def evaluate(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> Values:
        p = super().evaluate(si, active)
        p.wavelengths = si.wavelengths
        return p

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        return (TabulatedLobe(self.tables, p.scale, getattr(p, "wavelengths", None)),)


class TabulatedLobe(Lobe):
    """A table times a colour."""

    def __init__(self, tables: Tables, scale: Spectrum, wavelengths: Any) -> None:
        self.tables, self.colour, self.wavelengths = tables, scale, wavelengths
        self.anisotropic, self.reciprocal = tables.anisotropic, tables.reciprocal

    def estimated_albedo(self, wi: mi.Vector3f) -> Spectrum:
        """Return that at normal incidence: no other is asked for, as this is the only lobe."""
        return self.colour * self.tables.channels.colour(self.tables.albedo, wi, wi, self.wavelengths)

    def eval_pdf(self, wi: mi.Vector3f, wo: mi.Vector3f) -> tuple[Spectrum, mi.Float]:
        f = self.tables.channels.colour(self.tables.f, wi, wo, self.wavelengths)
        return self.colour * f * wo.z, self.tables.proposal.pdf(wi, wo)

    def sample(self, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        return self.tables.proposal.sample(wi, u, v)
