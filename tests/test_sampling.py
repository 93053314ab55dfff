"""Samplers: the density is what pdf says, and the weight is eval/pdf."""

import functools
import itertools

import mitsuba as mi
import numpy as np
import pytest
from catalogue import REPRESENTATIVES, ROWS, mostly_slow
from support import call, chi_square, context, direction, hemisphere

from mi_brdfs.lobes import MicrofacetLobe
from mi_brdfs.microfacet.distributions import GGX, Beckmann
from mi_brdfs.microfacet.fresnel import Unit
from mi_brdfs.microfacet.sampling import UniformDirections
from mi_brdfs.microfacet.shadowing import SmithGGX, VCavity
from mi_brdfs.microfacet.visible import VisibleNormals
from mi_brdfs.validation import check

EXACT = "finite", "horizon", "support", "eval_pdf", "reciprocity", "weight", "components", "flags", "active", "mode"
"""Checks of the public checker."""
ANGLES = [(0, 0), (80, 0), (60, 127)]


def contexts(bsdf):
    """The whole BSDF at all angles, and each of its components alone at two of them: what a component lacks shows in
    the mixture, too."""
    for angles in ANGLES:
        yield angles, context()
    if bsdf.component_count() > 1:
        yield from itertools.product(ANGLES[1:], map(context, range(bsdf.component_count())))


@functools.cache
def chi2_count():
    """How many χ² tests there are: their significance is corrected for it."""
    return sum(len(list(contexts(mi.load_dict(row.bsdf)))) for row in ROWS)


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("row", mostly_slow(ROWS))
def test_chi2(row):
    """The stock test, with cells that a lobe does not outrun. Without samples it would pass, hence the last line."""
    bsdf = mi.load_dict(row.bsdf)
    for angles, ctx in contexts(bsdf):
        resolution = {"res": 140, "ires": 32} if row.sharp else {"res": 101}
        test = chi_square(bsdf, ctx, direction(*angles), seed=ANGLES.index(angles), **resolution)
        accepted = test.run(test_count=chi2_count(), quiet=True)
        assert accepted, f"component {ctx.component} at {angles}: {test.messages}"
        assert test.histogram_sum[0] > 0.2


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("row", REPRESENTATIVES, ids=str)
def test_passes_the_checker(row):
    """Of the public checker, what needs no statistics. One angle of incidence does: it looks at directions all over,
    too."""
    report = check(row.bsdf, angles=(60,), only=EXACT)
    assert report.passed, report


@functools.cache
def mirror_grid(angles, radial, azimuthal, power=3):
    """Directions on a polar grid around the mirror direction of the one at ``angles``, denser towards it, and their
    solid angles."""
    s, phi = np.meshgrid((np.arange(radial) + 0.5) / radial, (np.arange(azimuthal) + 0.5) / azimuthal * 2 * np.pi)
    theta = np.pi * s**power
    solid_angle = np.sin(theta) * power * np.pi * s ** (power - 1) / radial * 2 * np.pi / azimuthal
    axis = direction(*angles) * [-1, -1, 1]
    side = np.cross(axis, [1, 0, 0] if abs(axis[0]) < 0.5 else [0, 1, 0])
    side /= np.linalg.norm(side)
    up = np.cross(axis, side)
    directions = [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]
    wo = sum(d[..., None] * base for d, base in zip(directions, (side, up, axis), strict=True))
    return wo.reshape(-1, 3).astype(np.float32), solid_angle.ravel()


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("row", mostly_slow(ROWS))
def test_density_integrates_to_one_at_most(row):
    """By the midpoint rule, good to 1e-3 on this grid. A lobe behind the surface may begin with a jump, so that grid
    gets a border in the horizon."""
    bsdf, grid = mi.load_dict(row.bsdf), (1600, 600)
    for angles, ctx in contexts(bsdf):
        wo, solid_angle = mirror_grid((0, 0), *grid, power=1) if row.transmits else mirror_grid(angles, *grid)
        pdf = call(bsdf.pdf, ctx, direction(*angles), wo)[0]
        assert 0.2 < (pdf[:, 0] * solid_angle).sum() < 1 + 1e-3


@pytest.mark.usefixtures("llvm_rgb")
def test_terms_bring_their_samplers():
    """A shadowing term the whole sampler, and a distribution its visible normals."""

    class Anywhere(VCavity):
        def sampler(self, distribution, fresnel, wi, reflect):
            return UniformDirections()

    class Seen(Beckmann):
        def visible_normals(self, wi):
            return VisibleNormals(GGX(self.alpha_u, self.alpha_v), wi)

    alpha = mi.Float(0.3), mi.Float(0.6)
    wi, wo = (mi.Vector3f(hemisphere(1000, seed).T) for seed in (1, 2))
    uniform = MicrofacetLobe(1, Beckmann(*alpha), Anywhere(), Unit())
    np.testing.assert_allclose(uniform.eval_pdf(wi, wo)[1], 1 / (2 * np.pi), rtol=1e-6)
    smith = SmithGGX(*alpha, correlated=False)
    brought, own = (MicrofacetLobe(1, d(*alpha), smith, Unit()).eval_pdf(wi, wo)[1] for d in (Seen, GGX))
    np.testing.assert_allclose(brought, own, rtol=1e-5)
