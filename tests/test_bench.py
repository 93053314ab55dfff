"""The bench measures what is known, catches what is worse, and says so."""

import json
import sys
from contextlib import nullcontext
from functools import partial

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from benchmarks import SECTIONS, resources, times
from benchmarks.cases import CASES, Case
from benchmarks.efficiency import efficiency, samplings
from benchmarks.times import ALONE, scene
from mutants import BakedIn, UniformDensity, UniformSampler, lambert, mutant, phong
from typer.testing import CliRunner

import mi_brdfs
from mi_brdfs.bench import comparison, pictures, statistics
from mi_brdfs.bench.comparison import compare
from mi_brdfs.bench.pictures import first_picture, in_new_process, render_in_turn
from mi_brdfs.bench.statistics import deviations, median_interval, time_variance
from mi_brdfs.cli import app
from mi_brdfs.lobes import LambertLobe, PowerLobe
from mi_brdfs.mitsuba.bsdf import ModelBSDF
from mi_brdfs.models.lambert import Lambert
from mi_brdfs.probe.bsdf import BSDFProbe

LAMBERT, WALTER = {"type": "lambert"}, {"type": "walter", "alpha": 0.5}
ANISOTROPIC = {"type": "walter", "alpha_u": 0.1, "alpha_v": 0.4}


class Uniform(UniformDensity, UniformSampler):
    """Lambert's lobe by uniform directions: w = 2ρ cosθ, so η = 1/(4/3)."""


class HalfLost(LambertLobe):
    """Every other direction is drawn below the horizon, where the weight is zero: η = ½."""

    def sample(self, wi, u, v):
        wo = super().sample(wi, u, v)
        return mi.Vector3f(wo.x, wo.y, dr.select(u < 0.5, wo.z, -wo.z))


class Boastful(PowerLobe):
    """Says that it reflects a hundred times as much, and takes the samples of the lobe beside it."""

    def estimated_albedo(self, wi):
        return 100 * super().estimated_albedo(wi)


class Leaking(ModelBSDF):
    """Keeps all its instances alive."""

    instances = []

    def __init__(self, props):
        ModelBSDF.__init__(self, props)
        Leaking.instances.append(self)


class Counted(Lambert):
    """Makes the number of the instance a literal in the kernel."""

    count = 0

    def lobes(self, p):
        if not hasattr(self, "number"):
            Counted.count += 1
            self.number = Counted.count
        return (LambertLobe(p.reflectance * (1 - 1e-3 * self.number)),)


def plugin(name, model, methods=ModelBSDF):
    return mutant(name, "", model, methods).register()


@pytest.fixture
def small(monkeypatch):
    sizes = {comparison: {"SIZE": 32, "FIRST_ROUNDS": 1, "LANES": 1 << 12, "CALL_ROUNDS": 7, "LOG2_POINTS": 10},
             pictures: {"SIZE": 32, "ROUNDS": 7}, statistics: {"RESAMPLINGS": 200},
             times: {"SIZE": 32, "FIRST_ROUNDS": 1, "FIRST_ROUNDS_OF_ALL": 1, "SCALAR_SIZE": 4, "SCALAR_SPP": 4,
                     "SCALAR_ROUNDS": 2}, resources: {"CYCLES": 60}}  # fmt: skip
    for module, values in sizes.items():
        for name, value in values.items():
            monkeypatch.setattr(module, name, value)


pytestmark = pytest.mark.usefixtures("llvm_rgb", "small")


def measured(section, cases):
    """The figures of a section for some cases only, by subject and name."""
    return {(figure.subject, figure.name): figure for figure in section(cases)}


def alternate(ours, theirs, name):
    return render_in_turn([partial(scene, bsdf, name) for bsdf in (ours, theirs)])


# --- Any two BSDFs --------------------------------------------------------------------------------------------------


class Chalk(Lambert):
    """A guest that draws uniform directions for Lambert's lobe."""

    def lobes(self, p):
        return (Uniform(p.reflectance),)


def test_two_bsdfs_beside_each_other(as_before, tmp_path):
    """Cosine-weighted directions are perfect for Lambert's lobe; of uniform ones η is 1/∫(2cosθ)² dω/2π = 3/4. Whatever
    the time, noise under BSDF samples and lights goes with it."""
    mi_brdfs.register(Chalk)
    words = ["bench", "lambert", "chalk", "-D", "reflectance=0.8", "--json", str(tmp_path / "it.json")]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    found = json.loads((tmp_path / "it.json").read_text())
    assert found["names"] == ["lambert reflectance=0.8", "chalk reflectance=0.8"]
    rows = {row["name"]: row for row in found["measurements"]}
    for angle in (5, 30, 60, 80):
        assert rows[f"η at {angle}°"]["values"] == pytest.approx([1, 0.75], abs=1e-3)
        assert f"η at {angle}°" in done.stdout
    assert all(len(rows[name]["values"]) == 2 and min(rows[name]["values"]) > 0 and rows[name]["ratio"][0] > 0
               for name in ("eval and sample", "picture", "first picture"))  # fmt: skip
    ours, theirs = rows["its variance"]["values"]
    assert ours < 0.95 * theirs
    assert rows["time × variance"]["ratio"][0] == pytest.approx(rows["picture"]["ratio"][0] * ours / theirs)


def test_one_bsdf_alone_and_what_no_other_process_knows(as_before):
    """A model of a function has no first picture; nothing has a ratio."""
    mi_brdfs.register(type("Local", (Chalk,), {"__doc__": "It cannot be imported.", "plugins": ("local",)}))
    found = compare({"type": "local"})
    names = [it.name for it in found.measurements]
    assert names[:4] == [f"η at {angle}°" for angle in comparison.ANGLES]
    assert found.measurements[0].values == pytest.approx([0.75], abs=1e-3)
    assert names[4:] == ["eval and sample", "picture", "its variance"]
    assert not any(it.ratio for it in found.measurements)


def test_the_time_of_calls_is_that_of_kernels(monkeypatch):
    """Four lobes take longer than one, and tracing does not count."""
    monkeypatch.setattr(comparison, "LANES", 1 << 18)
    bsdfs = [{"type": "burley", "sheen": 0.5, "clearcoat": 0.5}, LAMBERT]
    slow, fast = np.median(comparison.call_times([BSDFProbe(mi.load_dict(bsdf)) for bsdf in bsdfs]), axis=1)
    assert slow > 3 * fast > 0


# --- Efficiency -----------------------------------------------------------------------------------------------------


def test_a_known_efficiency():
    """At every angle, and whatever is reflected."""
    for reflectance in (0.5, 0.1):
        parts = samplings(plugin("half lost", lambert(HalfLost)) | {"reflectance": reflectance})
        assert list(parts) == ["whole"]
        np.testing.assert_allclose(parts["whole"].eta, 0.5, atol=1e-3)
        np.testing.assert_allclose(parts["whole"].albedo, 0.5 * reflectance, rtol=1e-3)


def test_the_worst_azimuth_counts(monkeypatch):
    together = samplings(ANISOTROPIC)["whole"].least()
    alone = []
    for azimuth in comparison.AZIMUTHS:
        monkeypatch.setattr(comparison, "AZIMUTHS", (azimuth,))
        alone.append(samplings(ANISOTROPIC)["whole"].least())
    np.testing.assert_allclose(together, np.min(alone, axis=0), atol=1e-6)
    assert np.ptp(alone, axis=0).max() > 0.01


def test_efficiencies_that_miss_their_targets():
    """A lobe below 0.95, a mixture far below its lobes, and ours below the built-in's, each by its reason."""
    diffuse = {"type": "diffuse"}
    cases = [
        Case("lambert", LAMBERT, diffuse, True),
        Case("uniform", plugin("uniform", lambert(Uniform)), diffuse, True),
        Case("boastful", plugin("boastful", phong(Boastful))),
        Case("phong", {"type": "phong"}),
        Case("another model", WALTER, diffuse),
    ]
    figures = measured(efficiency, cases)
    missed = {subject: {t.reason for t in it.missed} for (subject, name), it in figures.items() if name == "5°"}
    assert {"phong, component 0 (diffuse reflection)", "uniform / diffuse", "another model"} < missed.keys()
    assert {subject: reasons for subject, reasons in missed.items() if reasons} == {
        "uniform": {"each lobe", "that of diffuse"},
        "boastful": {"0.9 of its lobes' mean"},
    }
    assert figures["uniform", "gain"].value == pytest.approx(0.75, abs=1e-3)


# --- Time and variance ----------------------------------------------------------------------------------------------


def test_the_scene_of_bsdf_samples_shows_one_over_eta():
    """Uniform directions for Lambert's lobe: the variance of a sample is 1/η - 1 = ⅓ of its mean squared, everywhere
    on the sphere, which fills the picture."""
    bsdf = plugin("uniform", lambert(Uniform))
    luminance = alternate(bsdf, bsdf, ALONE).luminance
    np.testing.assert_allclose(luminance.mean(axis=1), 0.5, atol=0.25)
    np.testing.assert_allclose(deviations(luminance).mean(axis=1) * pictures.SPP, 1 / 3, rtol=0.06)


# --- Statistics -----------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_interval_of_a_median():
    """Of 15 values from the fourth to the twelfth, which holds the true median in 96.5 % of the cases; of few values
    their range."""
    values = np.random.default_rng(1).lognormal(sigma=0.5, size=(20_000, 15))
    inside = 0
    for row in values:
        median, (low, high) = median_interval(row)
        inside += low <= 1 <= high
        assert low <= median <= high
    assert inside / len(values) == pytest.approx(0.9648, abs=0.005)
    assert median_interval(np.arange(15.0)) == (7, (3, 11))
    assert median_interval(np.array([3.0, 1, 2])) == (2, (1, 3))
    assert median_interval(np.array([2.0])) == (2, (2, 2))


def test_the_interval_of_time_times_variance():
    """It holds the true ratio about as often as it says, less what a bootstrap of 15 pairs misses."""
    rng, n, repeats, inside = np.random.default_rng(2), 15, 400, 0
    for _ in range(repeats):
        slower = 1.3 * rng.lognormal(sigma=0.1, size=n)
        noise = rng.gamma(50, 1 / 50, (2, n)) * [[0.4], [0.8]]
        value, (low, high) = time_variance(slower, noise)
        inside += low <= 1.3 * 0.5 <= high
        assert low < value < high
    assert 0.88 < inside / repeats < 0.98


def test_deviations_of_known_pictures():
    """Pixels of different brightness count alike, black ones not at all, nor those that a single seed lights."""
    rng = np.random.default_rng(3)
    mean = np.concatenate([np.zeros(5000), np.geomspace(0.01, 100, 15_000)])
    pictures = mean * (1 + np.array([0.2, 0.1])[:, None, None] * rng.standard_normal((2, 15, len(mean))))
    pictures[:, 0, :100] = 1e-4
    found = deviations(pictures)
    assert found.shape == (2, 15)
    np.testing.assert_allclose(found.mean(axis=1), [0.04, 0.01], rtol=0.01)


# --- First pictures and resources -----------------------------------------------------------------------------------


@pytest.mark.slow
def test_first_pictures_compile(monkeypatch, tmp_path):
    """In a process that finds no kernels; if it does, it says so."""
    monkeypatch.setattr(pictures, "TemporaryDirectory", lambda: nullcontext(str(tmp_path)))
    assert 0.02 < in_new_process(first_picture, [LAMBERT]) < 60
    with pytest.raises(RuntimeError, match="kernels compiled by earlier runs"):
        in_new_process(first_picture, [LAMBERT])


def test_kernels_for_changes_are_counted():
    parameters, changed, loaded = resources.fresh_kernels(plugin("baked in", BakedIn))
    assert parameters == 1 and changed >= 1 and loaded == 0
    assert resources.fresh_kernels(plugin("counted", Counted))[2] >= 1


def leaking_cycles(rounds):
    return resources.load_render_discard([plugin("leaking", Lambert, Leaking)], rounds)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="memory is measured on Linux")
def test_a_leak_is_caught():
    """What stays alive is part of every kernel after it: each cycle compiles one."""
    seconds, memory = in_new_process(leaking_cycles, 30)
    assert len(seconds) == 30 and len(memory) == 31
    assert np.median(np.diff(memory[5::5])) > 0.5  # of warm cycles; a machine with other work may add a step


# --- All together ---------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_bench_of_everything(monkeypatch):
    """Small, with a few models: each section has figures with targets; what does not depend on the machine is
    reached."""
    few = [case for case in CASES if case.name in ("burley", "walter", "ward")]
    monkeypatch.setattr(times, "pairs", lambda: few[1:2])
    monkeypatch.setattr(times, "defaults", lambda: [LAMBERT, WALTER])
    threads = dr.thread_count()
    found = {name: list(section(few) if name in ("efficiency", "pictures", "recompiles") else section())
             for name, section in SECTIONS.items()}  # fmt: skip
    assert all(any(figure.targets for figure in figures) for figures in found.values())
    assert not [figure for figure in found["recompiles"] if figure.missed]
    assert dr.thread_count() == threads and mi.variant() == "llvm_ad_rgb"
    json.dumps([figure.to_dict() for figures in found.values() for figure in figures], allow_nan=False)
