"""The bench measures what is known, catches what is worse, and says so."""

import io
import json
import sys
from contextlib import nullcontext

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from generate import readme
from generate.models import model_table
from mutants import BakedIn, UniformDensity, UniformSampler, lambert, mutant, phong
from rich.console import Console

import mi_brdfs
from mi_brdfs.bench import SECTIONS, Figure, Results, Target, bench, process, renders, resources, runner, sizes, timing
from mi_brdfs.bench import run as bench_run
from mi_brdfs.bench.cases import BUILT_INS, TABLE, Case, all_cases, built_ins, defaults
from mi_brdfs.bench.efficiency import Sampling, _mean, efficiency, sampling
from mi_brdfs.bench.first import first_picture
from mi_brdfs.bench.renders import alternate
from mi_brdfs.bench.run import BenchRun
from mi_brdfs.bench.scenes import ALONE, BOX, PATH, SPHERE, scene_of, sphere
from mi_brdfs.bench.timing import deviations, median_interval, time_variance
from mi_brdfs.lobes import LambertLobe, PowerLobe
from mi_brdfs.mitsuba.bsdf import ModelBSDF
from mi_brdfs.mitsuba.registry import all_models, own_models
from mi_brdfs.models.lambert import Lambert

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
    for name, value in {
        "LOG2_POINTS": 10, "PICTURE": 32, "SPP": 16, "PAIRS": 7, "RESAMPLINGS": 200, "FIRST_PAIRS": 1,
        "FIRST_ALL_PAIRS": 1, "CYCLES": 60, "SCALAR_PICTURE": 4, "SCALAR_SPP": 4, "SCALAR_PAIRS": 2,
    }.items():  # fmt: skip
        monkeypatch.setattr(sizes, name, value)


pytestmark = pytest.mark.usefixtures("llvm_rgb", "small")


def measured(section, cases):
    """The figures of a section for some cases only, by subject and name."""
    run = BenchRun(lambda *_: None, cases)
    return {(figure.subject, figure.name): figure for figure in section(run)}


# --- Cases ----------------------------------------------------------------------------------------------------------


def test_cases_are_of_all_models():
    """Several of each, the defaults first; and each has a name of its own."""
    cases, by_model = all_cases(), {}
    for case in cases:
        by_model.setdefault(case.bsdf["type"], []).append(case.bsdf)
    assert list(by_model) == [model.plugins[0] for model in all_models()]
    assert all(sets[0] == {"type": name} for name, sets in by_model.items())
    assert all(len(by_model[model.plugins[0]]) >= 2 for model in own_models())
    assert len({case.name for case in cases}) == len(cases)
    assert [case for case in cases if case in TABLE] == TABLE
    assert defaults(cases) == [{"type": model.plugins[0]} for model in all_models()]


def test_as_many_built_ins_as_asked_for():
    assert built_ins(3) == BUILT_INS[:3]
    assert built_ins(len(BUILT_INS) + 2) == BUILT_INS + BUILT_INS[:2]


class Guest(Lambert):
    """A model of somebody else's.

    {"type": "guest", "reflectance": 0.9}
    """


def test_guests_are_measured(as_before):
    """By their defaults and their example; in processes of their own if these can import them."""
    mi_brdfs.register(Guest)
    mi_brdfs.register(type("Local", (Lambert,), {"__doc__": "It cannot be imported."}))
    cases = {case.name: case for case in all_cases() if case.name.split()[0] in ("guest", "local")}
    assert {name: case.bsdf for name, case in cases.items()} == {
        "guest": {"type": "guest"}, "guest example": {"type": "guest", "reflectance": 0.9}, "local": {"type": "local"},
    }  # fmt: skip
    assert defaults(list(cases.values())) == [{"type": "guest"}]
    figures = measured(efficiency, list(cases.values()))
    assert all(figures[name, "80°"].value == pytest.approx(1, abs=1e-3) for name in cases)
    assert process.in_new_process(first_picture, defaults(list(cases.values()))) > 0


def test_what_another_model_takes_the_name_of_has_no_cases_in_the_table(as_before):
    mi_brdfs.register(type("Other", (Lambert,), {"__doc__": "Another.", "plugins": ("low",)}), replace=True)
    assert [case.name for case in all_cases() if case.bsdf["type"] == "low"] == ["low"]


@pytest.mark.slow
def test_no_two_built_ins_are_of_the_same_code():
    kernels = set()
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        for bsdf in BUILT_INS:
            kernels.add(frozenset(resources._launched(mi.load_dict(sphere(bsdf, PATH, 16)))))
    assert len(kernels) == len(BUILT_INS)


def test_the_same_model_is_the_same_model():
    """``same`` says that the two reflect the same: to the noise, or where ``principled`` differs (its Fresnel and
    shadowing terms, its coat) nearly."""
    same = [case for case in TABLE if case.same]
    assert {case.bsdf["type"] for case in same} == {"lambert", "walter", "microfacet", "burley", "metallicroughness"}
    for case in same:
        ours, theirs = (sampling(bsdf)["whole"].albedo for bsdf in (case.bsdf, case.builtin))
        np.testing.assert_allclose(ours, theirs, rtol=0.22 if case.builtin["type"] == "principled" else 1e-3)


# --- Efficiency -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name, lobe, expected", [("cosine", LambertLobe, 1), ("uniform", Uniform, 0.75), ("half lost", HalfLost, 0.5)]
)
def test_known_efficiencies(name, lobe, expected):
    """At every angle, and whatever is reflected."""
    for reflectance in (0.5, 0.1):
        parts = sampling(plugin(name, lambert(lobe)) | {"reflectance": reflectance})
        assert list(parts) == ["whole"]
        np.testing.assert_allclose(parts["whole"].eta, expected, atol=1e-3)
        np.testing.assert_allclose(parts["whole"].albedo, reflectance * (0.5 if lobe is HalfLost else 1), rtol=1e-3)


def test_the_worst_azimuth_counts(monkeypatch):
    together = sampling(ANISOTROPIC)["whole"].least()
    alone = []
    for azimuth in sizes.AZIMUTHS:
        monkeypatch.setattr(sizes, "AZIMUTHS", (azimuth,))
        alone.append(sampling(ANISOTROPIC)["whole"].least())
    np.testing.assert_allclose(together, np.min(alone, axis=0), atol=1e-6)
    assert np.ptp(alone, axis=0).max() > 0.01


def test_the_mean_of_the_lobes_is_weighted_by_energy():
    """At the azimuth where the whole is worst."""
    lobes = [
        Sampling(np.array([[0.3, 0.9]]), np.array([[1.0, 0.1]])),
        Sampling(np.array([[0.1, 0.3]]), np.array([[0.6, 0.2]])),
    ]
    whole = Sampling(np.array([[0.4, 1.2]]), np.array([[0.5, 0.7]]))
    assert _mean(whole, lobes, 0) == pytest.approx((0.3 * 1 + 0.1 * 0.6) / 0.4)


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
    missed = {subject: {t.reason for t in figure.missed} for (subject, name), figure in figures.items() if name == "5°"}
    assert missed == {
        "lambert": set(),
        "lambert / diffuse": set(),
        "uniform": {"each lobe", "that of diffuse"},
        "uniform / diffuse": set(),
        "boastful": {"0.9 of its lobes' mean"},
        "boastful, component 0 (diffuse reflection)": set(),
        "boastful, component 1 (glossy reflection)": set(),
        "phong": set(),
        "phong, component 0 (diffuse reflection)": set(),
        "phong, component 1 (glossy reflection)": set(),
        "another model": set(),
    }
    assert figures["uniform", "gain"].value == pytest.approx(0.75, abs=1e-3)


# --- Time and variance ----------------------------------------------------------------------------------------------


def test_the_scene_of_bsdf_samples_shows_one_over_eta():
    """Uniform directions for Lambert's lobe: the variance of a sample is 1/η - 1 = ⅓ of its mean squared, everywhere
    on the sphere, which fills the picture."""
    bsdf = plugin("uniform", lambert(Uniform))
    renders = alternate(bsdf, bsdf, ALONE)
    np.testing.assert_allclose(renders.pictures.mean(axis=1), 0.5, atol=0.25)
    np.testing.assert_allclose(deviations(renders.pictures).mean(axis=1) * sizes.SPP, 1 / 3, rtol=0.06)


@pytest.mark.parametrize("scene", [SPHERE, BOX])
def test_a_bsdf_beside_itself(scene):
    """The same pictures from the same seeds; the times differ by what else the machine does."""
    renders = alternate(LAMBERT, LAMBERT, scene)
    np.testing.assert_allclose(renders.pictures[0], renders.pictures[1], rtol=1e-4)
    assert np.ptp(renders.pictures, axis=1).max() > 0
    value, (low, high) = time_variance(np.ones(sizes.PAIRS), deviations(renders.pictures))
    assert value == pytest.approx(1, rel=1e-4) and low <= value * 1.001 and high >= value / 1.001


def test_pairs_are_rendered_in_turn_and_alone(monkeypatch):
    """One first, then the other, with the same seed; and while one is rendered the other is not loaded, or else it
    would be part of the kernel."""
    rendered, render = [], renders.render

    def recording(scene, seed):
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            result = render(scene, seed)
            kernels = frozenset(kernel["hash"] for kernel in dr.kernel_history([dr.KernelType.JIT]))
        rendered.append((scene["sphere"]["bsdf"]["type"], seed, kernels))
        return result

    expected = {}
    for bsdf in (WALTER, LAMBERT):
        recording(scene_of(bsdf, SPHERE), 0)
        expected[bsdf["type"]] = rendered.pop()[2]
    monkeypatch.setattr(renders, "render", recording)
    alternate(WALTER, LAMBERT, SPHERE)
    assert all(kernels == expected[name] for name, _, kernels in rendered)
    pairs = [dict((rendered[k][:2], rendered[k + 1][:2])) for k in range(2, len(rendered), 2)]
    assert pairs == [{"walter": seed, "lambert": seed} for seed in range(sizes.PAIRS)]
    assert {rendered[k][0] for k in range(2, len(rendered), 2)} == {"walter", "lambert"}


def test_what_is_slower_and_quieter_is_told(monkeypatch):
    """``burley`` has four lobes where ``walter`` has one, and wastes less. The sections of times and of variances
    render once."""
    burley = {"type": "burley", "sheen": 0.5, "clearcoat": 0.5}
    cases = [Case("burley", burley, WALTER, True), Case("other", LAMBERT, WALTER)]
    renders = {}

    def recording(ours, theirs, scene):
        assert (ours["type"], scene) not in renders
        renders[ours["type"], scene] = result = alternate(ours, theirs, scene)
        return result

    monkeypatch.setattr(bench_run, "alternate", recording)
    run = BenchRun(lambda *_: None, cases)
    times = {(f.subject, f.name): f for f in timing.time(run)}
    variances = {(f.subject, f.name): f for f in timing.variance(run)}
    assert len(renders) == 3 + 2
    slower = times["burley / walter", SPHERE]
    assert slower.value > 1.3 and slower.missed and slower.interval[0] <= slower.value <= slower.interval[1]
    ours, theirs = (times["burley / walter", f"{SPHERE}, {name}"].value for name in ("ours", "built-in"))
    assert ours > 1.3 * theirs > 0
    alone, noise = (variances["burley / walter", f"{ALONE}{words}"] for words in ("", ", variance"))
    assert noise.value < 0.2 and not alone.targets
    ours, theirs = renders["burley", ALONE].seconds
    assert alone.value == pytest.approx(noise.value * np.median(ours / theirs))
    assert variances["burley / walter", SPHERE].targets == (Target("≤", 1.0, "walter"),)
    other = "other / walter, another model"
    assert (other, ALONE) not in variances and not variances[other, SPHERE].targets
    assert times[other, SPHERE].targets


def test_nothing_is_compared_with_no_noise():
    black = {"type": "diffuse", "reflectance": 0.0}
    figures = measured(timing.variance, [Case("black", LAMBERT, black, True)])
    assert {name for _, name in figures} == {BOX, f"{BOX}, variance"}  # whose other walls are not black


# --- Statistics -----------------------------------------------------------------------------------------------------


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


def test_first_pictures_compile(monkeypatch, tmp_path):
    """In a process that finds no kernels; if it does, it says so."""
    assert 0.02 < process.in_new_process(first_picture, [LAMBERT]) < 60
    monkeypatch.setattr(process, "TemporaryDirectory", lambda: nullcontext(str(tmp_path)))
    process.in_new_process(first_picture, [LAMBERT])
    with pytest.raises(RuntimeError, match="kernels compiled by earlier runs"):
        process.in_new_process(first_picture, [LAMBERT])


def test_kernels_for_changes_are_counted():
    assert resources.fresh_kernels({"type": "walter"}) == (2, 0, 0)
    parameters, changed, loaded = resources.fresh_kernels(plugin("baked in", BakedIn))
    assert parameters == 1 and changed >= 1 and loaded == 0
    assert resources.fresh_kernels(plugin("counted", Counted))[2] >= 1


def leaking_cycles(rounds):
    return resources.load_render_discard([plugin("leaking", Lambert, Leaking)], rounds)


@pytest.mark.skipif(sys.platform != "linux", reason="reads the resident memory from /proc")
def test_a_leak_is_caught(monkeypatch, pytestconfig):
    """What stays alive is part of every kernel after it: each cycle compiles one. What does not stay costs nothing."""
    monkeypatch.setenv("PYTHONPATH", str(pytestconfig.rootpath / "tests"))
    growth = []
    for function, given in ((resources.load_render_discard, [[LAMBERT]]), (leaking_cycles, [])):
        seconds, memory = process.in_new_process(function, *given, 30)
        assert len(seconds) == 30 and len(memory) == 31
        growth.append(memory[-1] - memory[0])
    assert growth[0] < 3 < growth[1]


def test_slowdown():
    """By the best of each part, and the median of the BSDFs."""
    early, late = [[1, 2, 4], [5, 2, 9]], [[1.1, 7, 4], [9, 3, 8]]
    assert resources.slowdown([*early, [50, 50, 50], *late], 2) == pytest.approx(1.1)


# --- Results --------------------------------------------------------------------------------------------------------


def figure(value, *targets, section="time", subject="walter", name="sphere", digits=2, unit="×", interval=None):
    return Figure(section, subject, name, value, digits, unit, interval, targets)


@pytest.mark.parametrize(
    "value, target, met",
    [
        (1.05, Target("≤", 1.05, ""), True),
        (1.054, Target("≤", 1.05, ""), True),
        (1.056, Target("≤", 1.05, ""), False),
        (0.95, Target("≥", 0.95, ""), True),
        (0.944, Target("≥", 0.95, ""), False),
        (float("nan"), Target("≥", 0.95, ""), False),
        (float("nan"), Target("≤", 0.95, ""), False),
    ],
)
def test_judged_as_shown(value, target, met):
    assert (not figure(value, target).missed) == met
    assert figure(value, target).marked.endswith("!") == (not met)


def results():
    slow = figure(1.2, Target("≤", 1.05, "roughconductor"), interval=(1.1, 1.3), subject="walter / roughconductor")
    lobes = [figure(eta, Target("≥", bound, "each lobe"), digits=3, unit="", section="efficiency", name=name)
             for eta, bound, name in ((0.97, 0.95, "5°"), (0.8, 0.85, "80°"))]  # fmt: skip
    fast = figure(1.0, subject="lambert / diffuse")
    cases = {
        name: {"name": name, "bsdf": {"type": name}, "builtin": {"type": builtin}, "same": True}
        for name, builtin in (("walter", "roughconductor"), ("lambert", "diffuse"))
    }
    setup = {"mitsuba": "3.9", "drjit": "1.5", "variant": "llvm_ad_rgb", "threads": "2"}
    return Results([*lobes, slow, fast], setup, cases)


def test_results_in_json():
    data = json.loads(json.dumps(results().to_dict()))
    assert Results.from_dict(data) == results()
    assert [figure["missed"] for figure in data["figures"]] == [False, True, True, False]
    assert data["missed"] == [
        "efficiency: walter: 80° is 0.800, and should be ≥ 0.850 (each lobe).",
        "time: walter / roughconductor: sphere is 1.20× [1.10, 1.30], and should be ≤ 1.05 (roughconductor).",
    ]


def test_results_as_tables():
    console = Console(width=200, record=True, file=io.StringIO())
    for table in results().tables():
        console.print(table)
    lines = [line.split() for line in console.export_text().splitlines()]
    assert ["walter", "0.970", "0.800", "!"] in lines
    assert ["walter", "/", "roughconductor", "1.20×", "[1.10,", "1.30]", "!"] in lines
    assert ["lambert", "/", "diffuse", "1.00×"] in lines


def test_results_in_markdown():
    text = results().markdown()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")]
    assert len({len(row) for row in rows}) == 1
    assert rows[2:] == [
        ["`walter` / `roughconductor`", "0.800 to 0.970 !", "", "1.20× !", "", "", ""],
        ["`lambert` / `diffuse`", "", "", "1.00×", "", "", ""],
    ]
    assert "* The least efficiency η = E[w]²/E[w²] of a lobe of any model is 0.970 at 5°, 0.800 ! at 80°." in text
    assert "* Of 3 targets 2 are missed !" in text


def test_a_page_has_the_summary(monkeypatch, tmp_path):
    monkeypatch.setattr(readme, "MEASURED", tmp_path / "bench.json")
    readme.MEASURED.write_text(json.dumps(results().to_dict()), encoding="utf-8")
    assert readme.bench() == f"{readme.INTRODUCTION}\n{results().markdown()}"


def test_the_readme_has_the_models(monkeypatch, tmp_path):
    """Between its marks, once; what is outside stays."""
    monkeypatch.setattr(readme, "README", tmp_path / "README.md")
    readme.README.write_text("before\n<!-- models -->\nold\n<!-- end of models -->\nafter\n", encoding="utf-8")
    for _ in range(2):
        readme.README.write_text(readme.text(), encoding="utf-8")
        text = f"before\n<!-- models -->\n\n{model_table()}\n<!-- end of models -->\nafter\n"
        assert readme.README.read_text(encoding="utf-8") == text
    readme.README.write_text("before\nafter\n", encoding="utf-8")
    with pytest.raises(ValueError, match="no place between <!-- models -->"):
        readme.text()


# --- All together ---------------------------------------------------------------------------------------------------


def test_bench_runs_what_is_asked_for(monkeypatch):
    told = []
    monkeypatch.setattr(runner, "all_cases", lambda: TABLE[:2])
    found = bench(iter(["recompiles"]), lambda *progress: told.append(progress))
    assert told == [("recompiles", 0, 2), ("recompiles", 1, 2)]
    assert found.sections == ["recompiles"] and found.setup["variant"] == "llvm_ad_rgb"
    assert not found.missed and set(found.cases) == {case.name for case in TABLE[:2]}


def test_wrong_usage():
    with pytest.raises(ValueError, match="There is no section 'speed'; there are efficiency, time"):
        bench(["speed"])
    with mi.variant_context("scalar_rgb"), pytest.raises(ValueError, match="vectorized and unpolarized"):
        bench(["efficiency"])


@pytest.mark.slow
def test_bench_of_everything():
    """Small, but complete: each section has figures with targets; what does not depend on the machine is reached."""
    threads = dr.thread_count()
    found = bench()
    assert found.sections == list(SECTIONS)
    assert all(any(figure.targets for figure in found.of(section)) for section in SECTIONS)
    assert not [figure for figure in found.of("recompiles") if figure.missed]
    assert dr.thread_count() == threads and mi.variant() == "llvm_ad_rgb"
    json.dumps(found.to_dict(), allow_nan=False)
    assert found.markdown().count("\n| `") == sum(case.same for case in TABLE)
