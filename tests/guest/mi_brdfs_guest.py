"""A model with a kind of parameter of its own, a distribution of facets, and a shadowing term with a sampler, as a
package of somebody else brings them."""

import drjit as dr
import mitsuba as mi

import mi_brdfs
from mi_brdfs.lobes import Lobe
from mi_brdfs.math import clamp
from mi_brdfs.microfacet import Distribution, Shadowing
from mi_brdfs.parameters import Number, Parameter, ParameterRow, Quantity, Reflectance


class Percent(Parameter):
    """A share in percent. Evaluated, the share."""

    def __init__(self, default, text):
        super().__init__(text)
        self.default, self.limits = default, (0, 100)

    @property
    def spellings(self):
        return [(Quantity(self.names[0], self.limits, self.default, self.text),)]

    @property
    def tried(self):
        return 0.0, 25.0, 50.0, 75.0

    def bind(self, reader):
        name = self.names[0]
        texture = reader.number(name, self.default, self.limits)
        return self.replace(textures={name: texture}, ranges={name: self.limits})

    def evaluate(self, si, active):
        return 0.01 * clamp(self.textures[self.names[0]].eval_1(si, active), *self.limits)

    def placeholder(self):
        return mi.Float(0)

    def rows(self):
        return [ParameterRow(self.names[0], "number", f"{self.default:g}", "[0, 100] %", self.text)]


class LommelSeeliger(mi_brdfs.Model):
    """The law of Lommel and Seeliger, of a thick layer of dark dust (1887).

    H. Seeliger, Zur Photometrie zerstreut reflectirender Substanzen, Sitzungsberichte der königlich bayerischen
    Akademie der Wissenschaften 18, 1888.

        f = (1 - c) w / (4π (cosθ_i + cosθ_o))

    Reciprocal. Energy-conserving. One-sided.
    """

    plugins = ("regolith", "dust")

    w = Reflectance(0.3, "single-scattering albedo w")
    craters = Percent(0, "part c of the surface that is black, in percent")

    def lobes(self, p):
        return (LommelLobe(p.w * (1 - p.craters)),)


class LommelLobe(Lobe):
    glossy = False

    def __init__(self, w):
        self.w = w

    def estimated_albedo(self, wi):
        return 0.5 * self.w * (1 - wi.z * dr.log(1 + 1 / dr.maximum(wi.z, 1e-4)))

    def eval_pdf(self, wi, wo):
        return self.w / (4 * dr.pi * (wi.z + wo.z)) * wo.z, wo.z * dr.inv_pi

    def sample(self, wi, u, v):
        return mi.warp.square_to_cosine_hemisphere(v)


class StudentT(Distribution):
    """D = (1 + t/(γ-1))^-γ / (π αu αv h_z⁴) with t = ((h_x/αu)² + (h_y/αv)²)/h_z², Student's t-distribution of slopes
    (Ribardière, Bringier, Meneveaux and Simonot 2017, doi:10.1111/cgf.13137); q = D cosθ_h."""

    word = "student-t"
    parameters = {
        "alpha": Number(0.1, (1e-4, 2), "roughness α of the facets", anisotropic=True),
        "gamma": Number(2.5, (1.5, 40), "exponent γ: the lower, the longer the tail"),
    }
    long_tailed = True

    def __init__(self, alpha_u, alpha_v, gamma):
        super().__init__(alpha_u, alpha_v)
        self.gamma = gamma

    def eval(self, facet):
        cos2 = dr.maximum(dr.square(facet.cos_h), 1e-6)
        tail = dr.power(1 + self.steepness(facet) / (cos2 * (self.gamma - 1)), -self.gamma)
        return tail / (dr.pi * self.alpha_u * self.alpha_v * dr.square(cos2))

    def cdf(self, tan2, g):
        complement = dr.power(1 + dr.minimum(g * tan2, 1e30) / (self.gamma - 1), 1 - self.gamma)
        return 1 - complement, complement

    def inverse_cdf(self, c, complement, g):
        return (dr.power(dr.maximum(complement, 1e-30), 1 / (1 - self.gamma)) - 1) * (self.gamma - 1) / g


class Bare(Shadowing):
    """G = cosθ_i cosθ_o, of rough facets whose reflections are drawn as from a diffuse surface."""

    word = "bare"
    parameters = {}

    def __call__(self, facet):
        return facet.cos_i * facet.cos_o

    def sampler(self, distribution, fresnel, wi, reflect):
        return CosineDirections()


class CosineDirections:
    def draw(self, u, v):
        return mi.warp.square_to_cosine_hemisphere(v)

    def pdf(self, facet):
        return facet.wo.z * dr.inv_pi
