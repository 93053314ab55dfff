"""Samplers: the density is what pdf says, and the weight is eval/pdf."""

import functools

import mitsuba as mi
import numpy as np
import pytest
from catalogue import REPRESENTATIVES, ROWS, mostly_slow
from support import chi_square, context, direction, hemisphere

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
    """The whole BSDF at all angles, and each of its components alone at one of them: what a component lacks shows in
    the mixture, too."""
    yield from ((angles, context()) for angles in ANGLES)
    if bsdf.component_count() > 1:
        yield from ((ANGLES[-1], context(k)) for k in range(bsdf.component_count()))


@functools.cache
def chi2_count():
    """How many χ² tests there are: their significance is corrected for it."""
    return sum(len(list(contexts(mi.load_dict(row.bsdf)))) for row in ROWS)


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("row", mostly_slow(ROWS))
def test_chi2(row):
    """The stock test, with cells that a lobe does not outrun. It would pass without samples, and with a density that is
    a percent too large: so this integrates to the share of samples that count, good to 1e-3."""
    bsdf = mi.load_dict(row.bsdf)
    for angles, ctx in contexts(bsdf):
        resolution = {"res": 140, "ires": 32} if row.sharp else {"res": 101}
        test = chi_square(bsdf, ctx, direction(*angles), seed=ANGLES.index(angles), **resolution)
        accepted = test.run(test_count=chi2_count(), quiet=True)
        assert accepted, f"component {ctx.component} at {angles}: {test.messages}"
        drawn = test.histogram_sum[0]
        assert drawn > 0.2
        assert test.pdf_sum[0] == pytest.approx(drawn, abs=2e-3)


RICHEST = {row.bsdf["type"]: row for row in REPRESENTATIVES}
"""Of each model the row with the most parameters."""


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("row", REPRESENTATIVES, ids=str)
def test_passes_the_checker(row):
    """Of the public checker, what needs no statistics, and of a model's other choices what depends on them alone. One
    angle of incidence does: it looks at directions all over, too."""
    report = check(row.bsdf, angles=(60,), only=EXACT if row in RICHEST.values() else ("reciprocity", "flags"))
    assert report.passed, report


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
