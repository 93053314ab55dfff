"""The ground floor of all measurements: directions, variates, partitions of the sphere, chi²."""

import numpy as np
import pytest
from support import von_mises_fisher

from mi_brdfs.probe.chi_square import chi_square
from mi_brdfs.probe.directions import direction
from mi_brdfs.probe.partition import partitions


@pytest.mark.parametrize("width", [1e-3, 0.03, 1])
def test_partitions_integrate_densities_of_any_width(width):
    """Here a von Mises-Fisher density about a direction at 60°, cut off at the horizon, to 1e-4 of its integral on a
    fine grid in its own angles; and its cells hold what they should of its own samples."""
    axis, count = direction(60, 20).astype(np.float64), 200_000
    w, density = von_mises_fisher(axis, width, 2 * count)
    pilot, samples = w[:count], w[count:]

    def pdf(wo):
        return np.where(wo[:, 2] > 0, density(wo), 0)

    (cells,) = partitions(lambda _, wo: pdf(wo), [pilot[pilot[:, 2] > 0]], [axis], count)
    above = samples[samples[:, 2] > 0]
    share = (w[:, 2] > 0).mean()
    assert cells.integrals.sum() == pytest.approx(share, abs=4 * np.sqrt(share * (1 - share) / len(w)) + 1e-4)
    test = chi_square(cells.histogram(above), count * cells.integrals)
    assert test.p_value > 1e-3 and test.degrees > 500
    side = np.cross(axis, [0, 0, 1])
    shifted = chi_square(cells.histogram(above + 0.1 * width * side / np.linalg.norm(side)), count * cells.integrals)
    assert shifted.p_value < 1e-6


def test_chi_square_has_its_distribution():
    """Of 500 tests, 5 % have a p-value below 0.05, whether cells are pooled or not."""
    rng = np.random.default_rng(2)
    for expected in (np.full(300, 50.0), np.geomspace(0.01, 200, 300)):
        p = [chi_square(rng.poisson(expected), expected).p_value for _ in range(500)]
        assert np.mean(np.array(p) < 0.05) == pytest.approx(0.05, abs=0.035)
