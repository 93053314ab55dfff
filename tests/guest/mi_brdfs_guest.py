"""A model and a distribution of facets, as a package of somebody else brings them."""

import drjit as dr
import mitsuba as mi

import mi_brdfs
from mi_brdfs.lobes import Lobe
from mi_brdfs.microfacet import Distribution
from mi_brdfs.parameters import Number, Reflectance


class LommelSeeliger(mi_brdfs.Model):
    """The law of Lommel and Seeliger, of a thick layer of dark dust (1887).

    H. Seeliger, Zur Photometrie zerstreut reflectirender Substanzen, Sitzungsberichte der königlich bayerischen
    Akademie der Wissenschaften 18, 1888.

        f = w / (4π (cosθ_i + cosθ_o))

    Reciprocal. Energy-conserving. One-sided.
    """

    plugins = ("regolith", "dust")

    w = Reflectance(0.3, "single-scattering albedo w")

    def lobes(self, p):
        return (LommelLobe(p.w),)


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
