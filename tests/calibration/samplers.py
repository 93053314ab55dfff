"""The choice of a sampler: the mean relative variance times the cost of each that suits GGX with a shadowing and a
Fresnel term, beside that of the one which is chosen.

    python tests/calibration/samplers.py [--check]

``--check`` exits with 1 unless the chosen one has at most 1.2 times the least: costs are no better known.
"""

from __future__ import annotations

import sys

import numpy as np
from harness import directions, number, parser, relative_variance

from mi_brdfs.lobes import MicrofacetLobe
from mi_brdfs.microfacet.distributions import GGX
from mi_brdfs.microfacet.forward import WithForwardShare
from mi_brdfs.microfacet.fresnel import Conductor, Dielectric, Schlick, Unit
from mi_brdfs.microfacet.grazing import AntitheticNormalsTowardViewer
from mi_brdfs.microfacet.sampling import AntitheticNormals
from mi_brdfs.microfacet.shadowing import SchlickSmith
from mi_brdfs.microfacet.visible import AntitheticVisibleNormals, BoundedVisibleNormals

import mitsuba as mi  # isort: skip

ANGLES = 5, 30, 60, 80
ALPHAS = 0.1, 0.25, 0.5, 1
COSTS = {
    BoundedVisibleNormals: 1,
    AntitheticVisibleNormals: 1.6,
    AntitheticNormals: 2,
    AntitheticNormalsTowardViewer: 2.4,
}
"""Times of a sample and its density, about, in LLVM."""


def main():
    arguments = parser(__doc__).parse_args()
    mi.set_variant("llvm_ad_rgb")
    shadows = {
        "separable": lambda it: it.smith(correlated=False),
        "correlated": lambda it: it.smith(correlated=True),
        "schlick": lambda it: SchlickSmith(0.5 * it.roughness()),
    }
    reflectances = {
        "one": Unit(),
        "gold": Conductor(mi.Color3f(0.14, 0.37, 1.44), mi.Color3f(3.98, 2.39, 1.6)),
        "schlick": Schlick(number(0.04)),
        "dielectric": Dielectric(number(1.5)),
    }
    missed = False
    for g, make in shadows.items():
        for f, fresnel in reflectances.items():
            facets = [GGX(alpha, alpha) for alpha in map(number, ALPHAS)]
            lobes = [MicrofacetLobe(1, it, make(it), fresnel) for it in facets]
            chosen = lobes[0].sampler
            # A dielectric's has a share of its own besides.
            chosen, losses = type(chosen.sampler if isinstance(chosen, WithForwardShare) else chosen), {}
            leaning = AntitheticNormalsTowardViewer(steep=True)
            for sampler in BoundedVisibleNormals(), AntitheticVisibleNormals(), AntitheticNormals(), leaning:
                for lobe in lobes:
                    lobe.sampler = sampler
                variance = float(np.mean(relative_variance(lobes, directions(ANGLES))))
                losses[type(sampler)] = COSTS[type(sampler)] * variance
            good = losses[chosen] <= 1.2 * min(losses.values())
            missed |= not good
            told = ", ".join(f"{kind.__name__} {loss:.4f}" for kind, loss in losses.items())
            print(f"{g}, {f}: {told}; {chosen.__name__} is {'' if good else 'WRONGLY '}chosen")
    sys.exit(arguments.check and missed)


if __name__ == "__main__":
    main()
