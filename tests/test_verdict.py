"""What the checker's verdict says: of energy, of what was not judged, and of what reproduces a failure."""

import json
import shlex
import subprocess
import sys
import warnings
from types import SimpleNamespace
from xml.etree import ElementTree

import mitsuba as mi
import numpy as np
import pytest
from mutants import MUTANTS, Lambert, LambertLobe, Mutant, Ward, of_others, sampled
from support import ROOT
from test_cli import invoke

import mi_brdfs
from mi_brdfs.cli.app import imported
from mi_brdfs.mitsuba.registry import own_models
from mi_brdfs.model import warn_once
from mi_brdfs.probe.arrays import interaction, vectors
from mi_brdfs.probe.sources import find_sources, shared, split
from mi_brdfs.testing import assert_bsdf
from mi_brdfs.validation import Finding, Report, check, compare
from mi_brdfs.validation.report import block, junit

pytestmark = pytest.mark.usefixtures("llvm_rgb")

BRIGHT = {"diffuse_reflectance": 0.8, "specular_reflectance": 0.8}
PHONG = (
    '<bsdf type="phong"><float name="diffuse_reflectance" value="0.8"/>'
    '<float name="specular_reflectance" value="0.8"/></bsdf>'
)
WHITE = {"type": "burley", "base_color": 1.0}


def albedo(bsdf, **options):
    """The finding on the energy of the whole. Where it fails, the sampler is tested, too: at one angle is enough."""
    return check(bsdf, only=["albedo"], angles=(60,), **options).of("albedo")[0]


# --- Energy ---------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_what_gains_as_much_as_its_page_says_is_noted():
    """Also on two sides. Unless energy is to be conserved. No page says that one of Mitsuba's gains any."""
    words = "It gains energy, as {} says (2.10): light from 89° is reflected 1.19"
    for bsdf, who in ((WHITE, "its page"), ({"type": "twosided", "inner": WHITE}, "the page of burley")):
        found = albedo(bsdf)
        assert found.verdict == "note" and found.message.startswith(words.format(who)), found
        assert albedo(bsdf, conserves=True).verdict == "fail"
    assert albedo(WHITE, conserves=False).verdict == "info"
    assert (
        "as its page says (no limit)" in albedo({"type": "schlick", "variant": "plain"} | {"roughness": 1e-3}).message
    )
    for keeps in {"type": "burley"}, {"type": "twosided", "inner": {"type": "diffuse", "reflectance": 1.0}}:
        assert albedo(keeps).verdict == "pass"


@pytest.mark.slow
def test_radiance_that_is_refracted_gains_none():
    """Its solid angle grows by η² as it leaves a dielectric."""
    report = check({"type": "roughdielectric", "distribution": "ggx", "alpha": 0.3}, only=["albedo"])
    assert report.passed, report
    assert 0.85 < max(each["albedo"] for name, each in report.findings[0].data.items() if "behind" in name) <= 1.001


def test_a_bsdf_of_others_may_gain_nothing():
    options = {"only": ["albedo", "weight", "pdf", "finite", "support"], "angles": (30,)}
    assert check(of_others("as_bright_as_white", 1.0), **options).passed
    report = check(of_others("too_bright", 1.6), **options)
    assert [finding.check for finding in report.failures] == ["albedo"]
    assert "it gains energy: light from 0° is reflected 1.6 times" in report.failures[0].message


# --- The warning ----------------------------------------------------------------------------------------------------


def warnings_of(*bsdfs):
    """The sentences of loading some."""
    warn_once.cache_clear()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for bsdf in bsdfs:
            mi.load_dict(bsdf)
    return [str(each.message) for each in caught if each.category is mi_brdfs.EnergyWarning]


RGB = {"type": "rgb", "value": [0.1, 0.85, 0.1]}
EXCEEDS = [
    ({"type": "phong"} | BRIGHT, "phong: diffuse_reflectance + specular_reflectance = 1.6, but "),
    ({"type": "ward", "diffuse_reflectance": RGB}, "specular_reflectance = 1.05 in channel 2, but"),
    (
        {"type": "lafortune", "specular_reflectance_1": 0.5, "specular_reflectance_2": 0.1},
        "diffuse_reflectance + specular_reflectance_1 + specular_reflectance_2 = 1.1, but",
    ),
    ({"type": "walter", "diffuse_reflectance": 0.5}, "specular_reflectance = 1.5, but"),
    ({"type": "phong", "diffuse_reflectance": {"type": "spectrum", "value": 0.9}}, "specular_reflectance = 1.1, but"),
]
HARMLESS = [
    {"type": "phong", "diffuse_reflectance": 0.8},
    {"type": "phong", "diffuse_reflectance": {"type": "checkerboard"}, "specular_reflectance": 0.9},
    {"type": "ashikhminshirley"} | BRIGHT,
    {"type": "walter", "diffuse_reflectance": 0.5, "f0": 0.04},
    {"type": "cooktorrance", "diffuse_reflectance": 0.1, "material": "Au"},
    {"type": "phong", "normalization": "none"} | BRIGHT,
]


def test_colours_that_add_to_more_than_one_warn():
    """Once in a process, in any variant; others, defaults and examples do not."""
    for bsdf, words in EXCEEDS:
        (sentence,) = warnings_of(bsdf, bsdf)
        assert words in sentence and sentence.endswith("energy is conserved only up to 1.")
    defaults = [bsdf for model in own_models() for bsdf in ({"type": model.plugins[0]}, model.example())]
    for bsdf in [*HARMLESS, *defaults]:
        assert not warnings_of(bsdf), bsdf


def test_the_check_speaks_of_the_colours_of_now():
    """Not of those that were given."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mi_brdfs.EnergyWarning)
        bsdf = mi.load_dict({"type": "walter", "alpha": 1.0, "diffuse_reflectance": 0.3})
    found = albedo(bsdf)
    assert found.verdict == "note" and found.message.startswith("At most 0.9")  # rough facets lose light
    assert "diffuse_reflectance + specular_reflectance = 1.3, but" in found.message
    params = mi.traverse(bsdf)
    params["specular_reflectance.value"] = mi.Float(0.7)
    params.update()
    assert albedo(bsdf).verdict == "pass"


# --- What reproduces a failure --------------------------------------------------------------------------------------


def test_failures_say_what_reproduces_them():
    """The value that a sentence tells is that at its directions."""
    (mutant,) = (each for each in MUTANTS if each.name == "energy gained in blue")
    found = albedo(mutant.register())
    assert found.verdict == "fail" and "in channel 3 (" in found.message
    assert np.linalg.norm(found.at["wi"]) == pytest.approx(1, abs=1e-6)
    report = check({"type": "roughplastic"}, only=["finite"])
    # All are no numbers in the horizon, and the last one negative below it.
    assert len(report.failures) == 3
    finding = report.failures[2]
    context = mi.BSDFContext()
    context.component = 1
    wi, wo = (np.array(finding.at[name], np.float32) for name in ("wi", "wo"))
    pdf = mi.load_dict({"type": "roughplastic"}).pdf(context, interaction(wi), vectors(wo))
    assert f"pdf is {pdf[0]:.4g} for" in finding.message and pdf[0] < 0
    assert f"At wi = [{', '.join(map(str, wi))}], wo = [" in report.sentences[2]


@pytest.mark.parametrize(
    "failing, first",
    [(["pdf", "chi2", "albedo"], "pdf"), (["reciprocity", "pdf", "albedo"], "pdf"),
     (["reciprocity", "chi2"], ""), (["reciprocity", "polarization"], ""), (["weight", "weight"], "")],
)  # fmt: skip
def test_what_is_to_be_fixed_first_may_be_the_cause(failing, first):
    """Of a density, others see the faults, too; of what is not reciprocal, they do not."""
    report = Report("mine", [Finding(check, "whole", "fail", "It is wrong.") for check in failing])
    told = [line for line, _ in block(report, 80) if "Fix" in line]
    assert told == ([f"  Fix {first} first; failures of later checks may follow from it."] if first else [])


def test_what_is_skipped_is_told_with_its_reason():
    findings = [Finding("deltas", "whole", "skip", "There is none."), Finding("null", "whole", "skip", "It is opaque.")]
    told = [line for line, _ in block(Report("mine", findings), 80)]
    assert "  skip  deltas: There is none. null: It is opaque." in told


# --- Comparison -----------------------------------------------------------------------------------------------------


def test_bsdfs_are_compared():
    rough = {"type": "roughconductor", "distribution": "ggx", "material": "none", "alpha": 0.3}
    same = compare({"type": "walter", "alpha": 0.3}, rough)
    assert same.passed and same.findings[0].data["difference"] < 1e-5
    assert "The largest relative difference is" in same.findings[0].message
    (fault,) = compare({"type": "walter", "alpha": 0.301}, rough, name="x").failures
    wi, wo = (np.array(fault.at[name], np.float32) for name in ("wi", "wo"))
    ours, theirs = (
        mi.load_dict(bsdf).eval(mi.BSDFContext(), interaction(wi), vectors(wo))[0][0]
        for bsdf in ({"type": "walter", "alpha": 0.301}, rough)
    )
    assert f"{ours:.6g}, but {theirs:.6g} of roughconductor" in fault.message
    assert fault.data["difference"] == pytest.approx(abs(ours / theirs - 1), rel=0.02)
    assert "The largest relative difference" not in compare({"type": "conductor"}, rough).why_not_judged
    back = compare({"type": "ward"}, {"type": "twosided", "inner": {"type": "ward"}})
    assert "behind" in back.failures[0].message
    black = {"reflectance": 0.0}
    assert compare({"type": "lambert"} | black, {"type": "diffuse"} | black).passed
    checked = {"type": "diffuse", "reflectance": {"type": "checkerboard", "color0": 0.5, "color1": 0.1}}
    assert compare(checked, checked).passed and not compare(checked, {"type": "diffuse"}).passed
    assert compare({"type": "plastic"}, {"type": "plastic"}).verdict("against") == "note"  # of its mirror


# --- Tests of users -------------------------------------------------------------------------------------------------


def test_assert_bsdf():
    assert assert_bsdf({"type": "ward"}, only=["weight"]).passed
    with pytest.raises(AssertionError) as raised:
        assert_bsdf({"type": "roughplastic"}, only=["finite", "weight"], angles=(30,))
    lines = str(raised.value).splitlines()
    assert lines[0] == "roughplastic: FAILED" and "finite, component 1 (diffuse reflection): pdf is" in lines[3]
    again = lines[-1].removeprefix("Again: ")
    report = eval(again, {"mi_brdfs": SimpleNamespace(validation=SimpleNamespace(check=check))})
    assert [f"finite, {finding.subject}: {finding.sentence}" for finding in report.failures] == lines[1:-1]
    with pytest.raises(AssertionError, match=r"conductor: not judged\nNothing was judged"):
        assert_bsdf({"type": "conductor"}, only="pdf")
    with pytest.raises(ValueError, match=r"in \[0, 90\) degrees, not 95"):
        assert_bsdf({"type": "ward"}, angles=(5, 95))
    with pytest.raises(ValueError, match=r"in \(0, 1\), not 0"):
        assert_bsdf({"type": "ward"}, significance=0)


# --- Files and the terminal -----------------------------------------------------------------------------------------

FINDINGS = [
    Finding("weight", "whole", "fail", "one is 2 (and 1 more like it).", {"faults": ["one is 2", "one is 1"]},
            {"wi": [0.0, 0.0, 1.0], "seed": 11}),
    Finding("albedo", "whole", "note", "It gains energy, as its page says (1.60)."),
    Finding("spectral", "whole", "skip", "It takes\x1b two < variants."),
    Finding("efficiency", "whole", "info", "η = 1."),
    *(Finding(f"a_check_with_a_name_{k}", "whole", "pass", "Right.") for k in range(12)),
]  # fmt: skip


def test_junit():
    root = ElementTree.fromstring(junit([Report("a & <b>", FINDINGS), Report("x", FINDINGS[1:])]))
    assert root.attrib == {"name": "mi-brdfs check", "tests": "31", "failures": "1", "skipped": "2"}
    suite, other = root
    assert suite.attrib == {"name": "a & <b>", "tests": "16", "failures": "1", "skipped": "1"}
    failed, noted, skipped, *_ = suite
    assert failed.attrib == {"classname": "a & <b>", "name": "weight, whole"}
    assert failed[0].tag == "failure" and failed[0].get("message") == FINDINGS[0].message
    assert failed[0].text.splitlines() == ["one is 2", "one is 1", "At wi = [0.0, 0.0, 1.0], seed = 11."]
    assert noted[0].tag == "system-out" and skipped[0].get("message") == "It takes\ufffd two < variants."
    assert other.get("failures") == "0"


SCENE = """<scene version="3.0.0"><default name="n" value="10"/>
<bsdf type="phong" id="plastic"><float name="exponent" value="$n"/></bsdf>
<shape type="sphere"><ref id="plastic"/></shape>
<shape type="cube"><ref id="plastic"/></shape>
<shape type="sphere"><bsdf type="twosided"><bsdf type="ward"/></bsdf></shape>
<shape type="disk"><bsdf type="ward"/></shape>
<shape type="disk"><bsdf type="ward"><float name="alpha" value="0.3"/></bsdf></shape>
<shape type="rectangle"><emitter type="area"/></shape>
<shape type="rectangle"><bsdf type="diffuse"><float name="reflectance" value="0"/></bsdf><emitter type="area"/></shape>
<shape type="rectangle"><bsdf type="lambert" id="lit"/><emitter type="area"/></shape>
<shape type="sphere"><bsdf type="null"/></shape>
</scene>"""


LIBRARY = """<bsdf type="twosided" id="sheet"><bsdf type="ward" id="gloss"/></bsdf></scene>"""


def test_materials_of_a_scene(tmp_path):
    """Each once, by its id or else its class, without the black ones of lamps; by an id any, also without a shape."""
    path = tmp_path / "s.xml"
    path.write_text(SCENE)
    names = ["TwoSidedBRDF of Ward", "Ward 1", "Ward 2", "lit", "plastic"]
    assert [source.name for source in find_sources(str(path))] == [f"s.xml:{name}" for name in names]
    (one,) = find_sources(f"{path}:plastic", {"n": "70"})
    assert (one.name, one.word) == ("s.xml:plastic n=70", f"{path}:plastic")
    assert mi.traverse(one.load())["exponent.value"] == 70
    alphas = [mi.traverse(next(find_sources(f"{path}:Ward {k}")).load())["alpha.value"][0] for k in (1, 2)]
    assert sorted(alphas) == pytest.approx([0.1, 0.3])
    with pytest.raises(ValueError, match="no such material; there are TwoSidedBRDF of Ward, Ward 1"):
        list(find_sources(f"{path}:gold"))
    path.write_text(SCENE[: SCENE.index("<shape")] + LIBRARY)
    with pytest.raises(ValueError, match=r"s.xml: no shape of the scene has a material; name one of its BSDFs, as .*:"):
        list(find_sources(str(path)))
    found = {id: next(find_sources(f"{path}:{id}", {"n": "7"})).load() for id in ("plastic", "sheet", "gloss")}
    assert [str(it).partition("[")[0] for it in found.values()] == ["Phong", "TwoSided", "Ward"]
    assert mi.traverse(found["plastic"])["exponent.value"] == 7
    (path := tmp_path / "a:b=c.xml").write_text('<!-- >< -->\n<bsdf type="ward" id="it"/>')  # no version, a trap
    assert [source.name for source in find_sources(str(path))] == ["a:b=c.xml"]


SCAN = str(ROOT / "scenes" / "measured" / "aeroglaze_z307.bsdf")
FITS = """[{"model": "ward", "file": "a.bsdf", "bsdf": {"type": "ward", "alpha": 0.2}},
{"model": "phong", "file": "a.bsdf", "bsdf": {"type": "phong", "exponent": 9}}]"""


def test_materials_have_parameters_of_their_own(tmp_path):
    """They go before those for all, of which each has what it declares."""
    (tmp_path / "fit.json").write_text(FITS)
    (tmp_path / "scene.xml").write_text(SCENE)
    fits, scene = str(tmp_path / "fit.json"), str(tmp_path / "scene.xml")

    def loaded(word, **parameters):
        sources = list(find_sources(word, parameters))
        return [it if isinstance(it, dict) else mi.traverse(it) for it in (source.load() for source in sources)]

    colour = {"type": "rgb", "value": [0.1, 0.2, 0.3]}
    assert loaded("ward:alpha=0.3,diffuse_reflectance=.1;.2;.3", alpha="0.1", rotation="9") == [
        {"type": "ward", "alpha": 0.3, "diffuse_reflectance": colour, "rotation": 9}
    ]
    assert loaded(f"{fits}:ward:alpha=.3") == [{"type": "ward", "alpha": 0.3}]
    assert loaded(fits, alpha="0.4") == [{"type": "ward", "alpha": 0.4}, {"type": "phong", "exponent": 9}]
    assert loaded(f"{scene}:plastic:n=33", n="12")[0]["exponent.value"] == 33
    words = ["ward", "phong", f"{fits}:phong", scene, '<bsdf type="ward"/>', "roughconductor", SCAN]
    given = shared(words, {"alpha": "1", "exponent": "2", "n": "3", "quantity": "f", "nope": "4"})
    assert [" ".join(own) for own in given] == [
        "alpha nope", "exponent nope", "exponent nope", "n nope", "nope", "alpha nope", "quantity nope",
    ]  # fmt: skip
    assert split("plot:alpha=.1,.2,variant=a") == ("plot", {"alpha": ".1,.2", "variant": "a"})
    assert split(r"C:\x\scene.xml:gold") == (r"C:\x\scene.xml:gold", {})
    for word, text in ("ward:alpha=", "write alpha=value"), (f"{fits}:gold", "there are ward, phong"):
        with pytest.raises(ValueError, match=text):
            list(find_sources(word))
    for text in '[{"model": "ward"}]', '[{"bsdf": {"type": "ward"}, "model": "ward", "file": 1}]':
        (tmp_path / "fit.json").write_text(text)
        with pytest.raises(ValueError, match="it holds no fits, as mi-brdfs fit --json writes them"):
            list(find_sources(fits))
    assert list(shared(['<bsdf type="$(a"/>', "ward"], {"(a": "1"})[0]) == ["(a"]


# --- The command ----------------------------------------------------------------------------------------------------


def run(*arguments):
    done = invoke("check", *arguments)
    assert all(len(line) <= 80 for line in done.stdout.splitlines() if not line.startswith("    Again: "))
    return done


def test_command_says_that_colours_gain_energy():
    done = run(PHONG, "--only", "albedo", "--angles", "60")
    text = " ".join(done.stdout.split())
    assert done.exit_code == 1 and "Warning" not in done.stderr
    assert "it gains energy: light from 0° is reflected 1.6 times" in text
    assert "diffuse_reflectance + specular_reflectance = 1.6, but energy is conserved only up to 1." in text


@pytest.mark.usefixtures("as_before")
def test_command_on_a_file_of_others(tmp_path):
    (tmp_path / "bright.py").write_text(
        "import mi_brdfs\n\n\nclass Bright(mi_brdfs.Model):\n"
        '    """A Lambertian that reflects too much."""\n\n'
        "    def lobes(self, p):\n        return (mi_brdfs.lobes.LambertLobe(1.6),)\n"
    )
    try:
        done = run("bright", "--import", tmp_path / "bright.py", "--only", "albedo", "--angles", "60")
        assert done.exit_code == 1 and "reflected 1.6 times" in done.stdout
        again = done.stdout.splitlines()[-1].partition("Again: mi-brdfs check ")[2]
        imported.clear()
        assert run(*shlex.split(again)).stdout == done.stdout
    finally:
        imported.clear()


def test_command_on_what_cannot_be_judged(tmp_path):
    done = run("conductor", "--only", "pdf", "--json", tmp_path / "x.json")
    assert done.exit_code == 3 and done.stdout.startswith("conductor: not judged\n")
    assert "Nothing was judged" in done.stdout and "Check a rough BSDF in its place" in done.stdout
    (report,) = json.loads((tmp_path / "x.json").read_text())
    assert not report["judged"] and not report["passed"]
    assert run("conductor", "lambert", "--only", "flags").exit_code == 0


def test_command_with_its_options(tmp_path):
    given = ["burley", "-D", "base_color=1.0", "-D", "roughness=0", "--param", "roughness=1", "--only", "albedo"]
    given += ["--angles", "5,83"]
    done = run(*given, "--junit", tmp_path / "x.xml", "--significance", "0.05")
    assert done.exit_code == 0 and "burley base_color=1.0 roughness=1: passed" in done.stdout
    assert "It gains energy, as its page says (2.10)" in " ".join(done.stdout.split())
    assert ElementTree.parse(tmp_path / "x.xml").getroot().get("failures") == "0"
    done = run(*given, "--conserves")
    again = done.stdout.splitlines()[-1].strip()
    assert done.exit_code == 1 and again == (
        "Again: mi-brdfs check burley -D base_color=1.0 -D roughness=1 --only albedo --angles 5,83 --conserves"
    )


def test_command_compares(tmp_path):
    rough = '<bsdf type="roughconductor"><string name="distribution" value="ggx"/></bsdf>'
    (tmp_path / "s.xml").write_text(SCENE)
    same = run("ward", "-D", "alpha=0.1", "--against", f"{tmp_path}/s.xml:TwoSidedBRDF of Ward", "--angles", "10")
    assert same.exit_code == 1 and "behind" in same.stdout  # which one side does not reflect from
    assert run("phong", "-D", "exponent=10", "--against", f"{tmp_path}/s.xml:plastic").exit_code == 0
    done = run("walter", "-D", "alpha=0.3", "--against", rough)
    assert done.exit_code == 1 and "the largest relative difference is 0." in " ".join(done.stdout.split())


@pytest.mark.slow
def test_commands_warn_in_a_sentence(tmp_path):
    scene = f"""<scene version="3.0.0"><integrator type="path"/><emitter type="constant"/>
    <shape type="sphere">{PHONG}</shape><shape type="cube">{PHONG}</shape>
    <sensor type="perspective"><film type="hdrfilm"><integer name="width" value="8"/>
    <integer name="height" value="8"/></film></sensor></scene>"""
    (tmp_path / "s.xml").write_text(scene)
    command = [sys.executable, "-m", "mi_brdfs", "render", "s.xml", "--spp", "1", "--variant", "scalar_rgb"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=180)
    told = "phong: diffuse_reflectance + specular_reflectance = 1.6, but energy is conserved only up to 1."
    assert done.returncode == 0 and done.stderr.splitlines()[0] == f"mi-brdfs: {told}"
    assert done.stderr.count("1.6") == 1


def test_a_wrong_constant_is_told_as_one():
    """A density without its 1/π is off by the same factor wherever light comes from."""
    wrong = next(mutant for mutant in MUTANTS if mutant.name == "density without pi")
    (finding,) = [it for it in check(wrong.register(), only=["pdf"], angles=(50,)).failures if it.subject == "whole"]
    assert "pdf integrates to 3.14" in finding.message and "it fails for all 17 directions tried" in finding.message
    assert finding.message.endswith(
        "3.14 everywhere: a constant is wrong, perhaps the π of cosine-weighted directions."
    )


def test_a_subclass_does_not_gain_the_energy_of_its_base():
    """The page of ``ward`` says that some of its variants gain energy."""

    class Brighter(Ward):
        def lobes(self, p):
            return (*super().lobes(p), LambertLobe(p.diffuse_reflectance))

    given = (("diffuse_reflectance", 0.9), ("variant", "ward"))
    mutant = Mutant("brighter", (), Brighter, given=given).register()
    assert albedo(mutant).verdict == "fail" and Ward.energy and not Brighter.energy
    assert albedo({"type": "ward", "variant": "ward"}).verdict == "pass"


def test_a_wrong_constant_of_weights_is_told_as_one():
    """What is reflected is not judged by such weights, even if it is less than is received."""
    of_half = Mutant("half", (), Lambert, sampled(weight=lambda bs, weight, si, u: 0.5 * weight))
    report = check(of_half.register(), only=["weight", "albedo"], angles=(50,))
    (finding,) = (it for it in report.failures if it.subject == "whole")
    assert finding.message.endswith("0.5 everywhere: a constant is wrong, perhaps the probability of one of two lobes.")
    assert report.verdict("albedo") == "skip" and "mend weight first" in report.of("albedo")[0].message
