"""The checker passes what is right, and says what is wrong."""

import json
import os
import shlex
import signal
import subprocess
import sys
import time
import warnings
from functools import partial

import drjit as dr
import mitsuba as mi
import numpy as np
import psutil
import pytest
from mutants import (
    MUTANTS,
    TWO,
    Mutant,
    adapted,
    changed,
    diffuse,
    in_spectra,
    lambert,
    mirrored,
    of_others,
    stranger,
    with_derivative,
    without_fields,
    wrapped,
)
from support import shared
from test_cli import invoke

import mi_brdfs
from mi_brdfs.lobes import LambertLobe
from mi_brdfs.models.lambert import Lambert
from mi_brdfs.probe.arrays import context
from mi_brdfs.validation import CHECKS, check
from mi_brdfs.validation import run as run_of_checks
from mi_brdfs.validation.incidents import random_incidents
from mi_brdfs.validation.runner import ANGLES

pytestmark = pytest.mark.usefixtures("llvm_rgb")

DIFFUSE, FRONT = mi.BSDFFlags.DiffuseReflection, mi.BSDFFlags.FrontSide
BOTH_SIDES = FRONT | mi.BSDFFlags.BackSide
QUICK: dict[str, Mutant] = {}
"""A mutant for each check, of Lambert's model if there is one."""
for each in sorted(MUTANTS, key=lambda it: not issubclass(it.model, Lambert)):
    if not QUICK.keys() & set(each.caught_by):
        QUICK |= dict.fromkeys(each.caught_by, each)


FAINT = "density off towards 40 to 50 degrees"
"""Five per cent of a density in one band: of so little the usual angles see more than one does."""


@pytest.mark.parametrize(
    "mutant", [pytest.param(it, id=it.name, marks=[] if it in QUICK.values() else pytest.mark.slow) for it in MUTANTS]
)
def test_mutants_are_caught(mutant):
    """By each check that is named for them, and by one angle, beside the directions that are looked at anyway. Faults
    of directions say what reproduces them."""
    report = check(mutant.register(), only=mutant.caught_by, angles=ANGLES if mutant.name == FAINT else (60,))
    assert {finding.check for finding in report.failures} == set(mutant.caught_by), report
    assert all(finding.message.endswith(".") for finding in report.failures)
    assert not any("could not be checked" in finding.message for finding in report.failures), report
    assert not report.passed
    for finding in report.failures:
        if finding.check in ("weight", "chi2", "reciprocity", "horizon"):
            assert len(finding.at["wi"]) == 3, finding
            assert ("seed" in finding.at) == (finding.check in ("weight", "chi2")) or finding.check == "horizon"


@pytest.mark.usefixtures("as_before")
def test_what_is_not_reciprocal_is_said_once():
    """By the check of that name, and in polarized variants, too, where it is not made."""
    (base,) = (it.model for it in MUTANTS if it.name == "missing cosine")
    mi_brdfs.register(type("OneWay", (base,), {"__doc__": "One way.", "plugins": ("one_way",)}))
    for only, failing in (["reciprocity", "polarization"], {"reciprocity"}), (["polarization"], {"polarization"}):
        assert {finding.check for finding in check({"type": "one_way"}, only=only, angles=(60,)).failures} == failing


def test_the_derivative_is_that_of_its_texel():
    """A Lambertian with the derivative at another one, whose texels have what the right ones have in sum."""

    def elsewhere(value, texture, si):
        other = mi.SurfaceInteraction3f(si)
        other.uv = mi.Point2f(si.uv.y, si.uv.x)
        return texture.eval(other)

    texels = mi.Bitmap(np.random.default_rng(1).uniform(0.1, 0.9, (8, 8, 3)).astype(np.float32))
    reflectance = {"type": "bitmap", "bitmap": texels, "raw": True}
    for of, is_wrong in ((elsewhere, True), (lambda value, texture, si: value, False)):
        given = Mutant("another texel", ("gradients",), with_derivative(of)).register()
        report = check(given | {"reflectance": reflectance}, only=["gradients"])
        (found,) = (it for it in report.of("gradients") if it.subject == "reflectance.data")
        assert any("its derivatives are off" in it for it in found.data["faults"]) == is_wrong, found


def turned(matrix, light, viewer):
    return mi.mueller.rotator(0.3) @ matrix


def beyond_its_intensity(matrix, light, viewer):
    return 1.3 * matrix - 0.3 * mi.mueller.depolarizer(matrix[0, 0])


def in_frames_of_the_facet(matrix, light, viewer):
    h = dr.normalize(viewer - light)
    axes = [dr.normalize(dr.cross(h, w)) for w in (light, viewer)]
    frames = [mi.mueller.stokes_basis(w) for w in (light, viewer)]
    return mi.mueller.rotate_mueller_basis(matrix, light, frames[0], axes[0], viewer, frames[1], axes[1])


FAULTY = [
    *(("eval", each) for each in (None, turned, beyond_its_intensity, in_frames_of_the_facet)),
    *((method, turned) for method in ("eval_pdf", "sample", "importance")),
]


@pytest.mark.parametrize(("method", "fault"), FAULTY)
def test_mueller_matrices(method, fault):
    """Of a rough conductor, with and without faults of a method, or of ``eval`` in the mode Importance."""

    def altered(own, ctx, si, *given):
        result = own(ctx, si, *given)
        if not (fault and mi.is_polarized) or (method == "importance" and ctx.mode == mi.TransportMode.Radiance):
            return result
        if method in ("eval", "importance"):
            return fault(result, -given[0], si.wi)
        if method == "eval_pdf":
            return fault(result[0], -given[0], si.wi), result[1]
        return result[0], fault(result[1], -result[0].wo, si.wi)

    for variant in ("llvm_ad_spectral_polarized", "llvm_ad_rgb"):
        mi.set_variant(variant)
        metal = {"type": "roughconductor", "distribution": "ggx", "alpha": 0.3, "material": "Au"}
        bsdf = wrapped("wrapped_metal", metal, **{"eval" if method == "importance" else method: altered})
    report = check(bsdf, only="polarization")
    assert report.verdict("polarization") == ("fail" if fault else "pass"), report


def like_two_polarizers(matrix, light, viewer):
    matrix[0, 1] = matrix[1, 0] = 2 * matrix[0, 0]
    return matrix


def with_no_numbers(matrix, light, viewer):
    matrix[0, 1] = np.nan
    return matrix


@pytest.mark.parametrize("fault", [None, like_two_polarizers, with_no_numbers])
def test_mueller_matrices_of_a_delta_function_beside_a_lobe(fault):
    def sample(own, ctx, si, *given):
        bs, weight = own(ctx, si, *given)
        if not (fault and mi.is_polarized):
            return bs, weight
        is_delta = bs.sampled_type == int(mi.BSDFFlags.DeltaReflection)
        return bs, dr.select(is_delta, fault(mi.Spectrum(weight), -bs.wo, si.wi), weight)

    for variant in ("llvm_ad_spectral_polarized", "llvm_ad_spectral", "llvm_ad_rgb"):
        mi.set_variant(variant)
        bsdf = wrapped("coated", {"type": "plastic"}, sample=sample)
    report = check(bsdf, only="polarization")
    assert report.verdict("polarization") == ("fail" if fault else "pass"), report


VALUES = "eval", "eval_pdf", "sample"
DIMMED = [
    *((bsdf, VALUES, 1) for bsdf in ("conductor", "plastic", "roughdielectric")),
    ("diffuse", VALUES, 1.02),
    ("diffuse", ("eval_pdf",), 0),
    *(("diffuse", ("sample",), factor) for factor in (0, 7)),
    ("conductor", ("sample",), 0.5),
]


@pytest.mark.parametrize(("given", "methods", "factor"), DIMMED)
def test_what_is_as_bright_in_polarized_variants_passes(given, methods, factor):
    """And what some methods have brighter or darker there alone fails, though its matrices are physical."""

    def dimmed(own, *given):
        first, *others = result if isinstance(result := own(*given), tuple) else (result,)
        if not mi.is_polarized:
            return result
        if not others:
            return first * factor
        return (first, others[0] * factor) if isinstance(first, mi.BSDFSample3f) else (first * factor, others[0])

    for variant in ("llvm_ad_spectral_polarized", "llvm_ad_spectral", "llvm_ad_rgb"):
        mi.set_variant(variant)
        bsdf = wrapped("dimmed", {"type": given}, **dict.fromkeys(methods, dimmed))
    report = check(bsdf, only="polarization")
    assert report.verdict("polarization") == ("pass" if factor == 1 else "fail"), report


@pytest.mark.parametrize(("key", "verdict"), [("table", "pass"), ("values", "fail")])
def test_what_is_kept_of_a_table_is_made_anew(key, verdict):
    """By a density of four steps of the cosine, whose sum is taken where that key is said to have changed."""

    def begin(self, props):
        self.table = mi.Float([0.1, 0.4, 0.2, 0.3])
        self.parameters_changed([])

    def parameters_changed(self, keys):
        if not keys or key in keys:
            self.mean = dr.mean(self.table)

    def eval_pdf(self, ctx, si, wo, active=True):
        step = dr.gather(mi.Float, self.table, mi.UInt(dr.clip(wo.z * 4, 0, 3)))
        pdf = dr.select(active & (wo.z > 0) & (si.wi.z > 0), step / (dr.two_pi * self.mean), 0)
        return mi.Color3f(0.5 * pdf), pdf

    def draw(si, v):
        return mi.warp.square_to_uniform_hemisphere(v)

    def traverse(self, callback):
        callback.put("table", self.table, mi.ParamFlags.Differentiable)

    methods = {"parameters_changed": parameters_changed, "traverse": traverse}
    steps = stranger("steps", DIFFUSE | FRONT, begin=begin, eval_pdf=eval_pdf, draw=draw, **methods)
    assert check(steps, only="updates").verdict("updates") == verdict


@pytest.mark.parametrize(("says", "bends"), [(0.3, False), (0.7, False), (0.3, True)])
def test_what_goes_straight_through(says, bends):
    """Of a veil that lets .3 of the light through."""

    def sample(own, ctx, si, *given):
        bs, weight = own(ctx, si, *given)
        straight = bs.sampled_type == int(mi.BSDFFlags.Null)
        bs.wo.z *= dr.select(straight & bends, mi.Float(-1), 1)
        return bs, weight

    inner = {"type": "mask", "opacity": 0.7, "inner": {"type": "diffuse"}}
    veil = wrapped("veil", inner, sample=sample, eval_null_transmission=lambda own, *given: mi.Color3f(says))
    assert check(veil, only="null").verdict("null") == ("pass" if says == 0.3 and not bends else "fail")


def test_shadow_rays_go_through_what_has_a_component_for_it():
    screen = stranger("screen", DIFFUSE | FRONT, eval_null_transmission=lambda self, si, active=True: mi.Color3f(0.3))
    (finding,) = check(screen, only="null").failures
    assert finding.message == "eval_null_transmission is 0.3, but no component is flagged Null."


def test_wavelengths_in_another_order():
    mi.set_variant("llvm_ad_spectral")
    first = in_spectra(lambda value, wavelengths: value * wavelengths[0] / 830)
    report = check(Mutant("of the first wavelength", ("spectral",), first).register(), only="spectral")
    assert "in another order of the wavelengths" in str(report.failures[0].data["faults"]), report


@pytest.mark.parametrize("behind", [1.0, 0.8])
def test_light_through_a_sheet_goes_back_as_it_came(behind):
    """Which lets half of the light through, evenly; from behind less, or as much."""

    def draw(si, v):
        up = mi.warp.square_to_cosine_hemisphere(v)
        return mi.Vector3f(up.x, up.y, dr.select(si.wi.z > 0, -up.z, up.z))

    def eval_pdf(self, ctx, si, wo, active=True):
        pdf = dr.select(active & (si.wi.z * wo.z < 0), dr.abs(wo.z) * dr.inv_pi, 0)
        return mi.Color3f(dr.select(si.wi.z > 0, 0.5, 0.5 * behind) * pdf), pdf

    sheet = stranger("sheet", mi.BSDFFlags.DiffuseTransmission | BOTH_SIDES, draw=draw, eval_pdf=eval_pdf)
    assert check(sheet, only="reciprocity").verdict("reciprocity") == ("pass" if behind == 1 else "fail")


def at_other_places(si):
    other = mi.SurfaceInteraction3f(si)
    other.uv = 1 - si.uv
    return other


BEHIND = {
    "gradients": lambda self, si: dr.detach(self.back.eval(si)),
    "textures": lambda self, si: self.back.eval(at_other_places(si)),
    "updates": lambda self, si: mi.Color3f(self.kept),
    "colours": lambda self, si: mi.Color3f(*reversed(self.back.eval(si))),
}


@pytest.mark.parametrize("named", [None, *BEHIND])
def test_the_back_is_looked_at(named):
    """Of a sheet with a texture on each side, with a fault of that on the back."""

    def begin(self, props):
        self.kept = self.back.mean()

    def eval_pdf(self, ctx, si, wo, active=True):
        colour = BEHIND[named](self, si) if named else self.back.eval(si)
        pdf = dr.select(active & (si.wi.z * wo.z > 0), dr.abs(wo.z) * dr.inv_pi, 0)
        return dr.select(si.wi.z > 0, self.front.eval(si), colour) * pdf, pdf

    def draw(si, v):
        up = mi.warp.square_to_cosine_hemisphere(v)
        return mi.Vector3f(up.x, up.y, dr.select(si.wi.z > 0, up.z, -up.z))

    sides = {"front": 0.3, "back": 0.6}
    sheet = stranger("two_colours", DIFFUSE | BOTH_SIDES, textures=sides, begin=begin, draw=draw, eval_pdf=eval_pdf)
    report = check(sheet, only=list(BEHIND))
    failed = [it for it in BEHIND if report.verdict(it) == "fail"]
    assert failed == {None: [], "updates": ["textures", "updates"]}.get(named, [named]), report


def test_samples_that_are_known_without_a_kernel_compile_none():
    """Those of a mirror that sends all light back."""

    def sample(self, ctx, si, sample1, sample2, active=True):
        bs = dr.zeros(mi.BSDFSample3f)
        bs.wo, bs.pdf, bs.eta, bs.sampled_type = si.wi, 1, 1, int(mi.BSDFFlags.DeltaReflection)
        return bs, self.colour.eval(si)

    back = stranger("sends_back", mi.BSDFFlags.DeltaReflection | BOTH_SIDES, textures={"colour": 0.5}, sample=sample)
    assert check(back, only="recompiles").passed


@pytest.mark.slow
def test_a_dict_is_checked_where_no_variant_is_active():
    code = "import mi_brdfs; print(mi_brdfs.validation.check({'type': 'lambert'}, only=['weight']).passed)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.stdout == "True\n", done.stderr


RIGHT = {
    "lambert": {"type": "lambert"},
    "phong sharp": {"type": "phong", "exponent": 300.0, **TWO},
    "burley": {"type": "burley", "clearcoat": 0.5, "sheen": 0.5},
    "transmission": {"type": "wrap", "domain": "sphere", "wrap": 0.8, "exponent": 1.5},
    "roughconductor sharp": {"type": "roughconductor", "alpha": 1e-3},
    "twosided": {"type": "twosided", "inner": {"type": "ward", "alpha_u": 0.1, "alpha_v": 0.3}},
    "textured": {"type": "walter", "alpha": 0.3, **TWO, "specular_reflectance": {"type": "checkerboard"}},
}


def look_at_few_directions(monkeypatch):
    """Of those at random, beside the angles that are asked for: a suspect one takes up to a second."""
    monkeypatch.setattr(run_of_checks, "random_incidents", lambda part, count: random_incidents(part, count // 4))


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name == "lambert" else pytest.mark.slow) for name in RIGHT]
)
def test_what_is_right_passes(name, monkeypatch):
    """The models that the mutants are made of among them."""
    if name != "lambert":
        look_at_few_directions(monkeypatch)
    report = check(RIGHT[name], name=name, angles=ANGLES if name == "lambert" else 60)
    assert report.passed, report
    assert {finding.check for finding in report.findings} == set(CHECKS)
    judged = {finding.check for finding in report.findings if finding.verdict == "pass"}
    skipped = {"reciprocity", "albedo", "efficiency", "textures", "gradients", "recompiles", "reflectance", "spectral"}
    skipped |= {"null", "deltas", "updates", "colours"}
    assert judged >= set(CHECKS) - skipped


def case(only, plugin, angles=ANGLES, **given):
    """The checks to make, the dict to check, and the angles that show the false alarm."""
    return {"only": only.split(), "angles": angles}, {"type": plugin, **given}


def texels(raw):
    """A bitmap of random colours."""
    values = np.random.default_rng(1).random((2, 2, 3)).astype(np.float32)
    return {"type": "bitmap", "bitmap": mi.Bitmap(values), "raw": raw}


NARROW = "pdf chi2 continuity"
FALSE_ALARMS = {
    "derivatives that cancel": case("active", "ward", rotation=0.3),
    "many turns": case("gradients", "ward", rotation=100.0, alpha_u=0.1, alpha_v=0.4),
    "a narrow round lobe, turned": case("gradients", "ward", alpha_u=1e-4, alpha_v=1e-4, rotation=76.0),
    "line of ward": case(NARROW, "ward", 60, alpha_u=0.906, alpha_v=0.0003),
    "line of walter": case(NARROW, "walter", alpha_u=0.5, alpha_v=0.001),
    "line at the normal": case(NARROW, "ward", 0, variant="ward", alpha_u=0.00015),
    "all light reflected, whatever is outside": case("gradients", "walter", int_ior=0.01),
    "what fades above the horizon": case(
        "continuity", "microfacet", alpha=1.326109236523212, shadowing="smith-correlated", multiscatter="kulla-conty"
    ),
    "hard edges": case(NARROW, "toon", 80, diffuse_threshold=0.62, specular_reflectance=1.0, specular_smooth=0.0),
    "a lobe below the horizon": case("chi2 pdf", "lafortune", cx=-0.4, cy=-1.5, cz=-1.5),
    "a black band": case("chi2 pdf", "toon", diffuse_threshold=1.0, diffuse_smooth=0.0),
    "peaks far narrower than steps": case("gradients", "schlick", roughness=1e-6, isotropy=0.01, rotation=0.3),
    "turns that float32 hardly knows": case("gradients", "ward", rotation=1e4, alpha_v=0.01),
    "lines at the horizon": case("chi2 pdf", "schlick", 60, roughness=1.1e-5, variant="interreflection"),
    "beyond what a choice leaves of a range": case("gradients", "cooktorrance", distribution="blinn", alpha=1.5),
    "narrow along and across": case(NARROW, "walter", alpha_u=0.0041, alpha_v=0.00035),
    "a band that is empty": case(
        "gradients continuity", "toon", diffuse_threshold=1.0, diffuse_smooth=0.0, diffuse_shadow=0.9
    ),
    "an edge at the horizon": case("gradients", "toon", diffuse_threshold=0.0, diffuse_smooth=0.0),
    "diffuse lobe beside facets": case("albedo", "walter", diffuse_reflectance=0.9, f0=0.9),
    "texels beyond a limit": case("gradients", "phong", specular_reflectance=texels(True)),
    "texels of an index down to that outside": case("gradients", "walter", int_ior=texels(True), ext_ior=0.01),
    "gradients of textures": case("textures", "bumpmap", arbitrary=texels(True), a={"type": "diffuse"}),
    "index above one as a colour": case("colours spectral", "low", variant="microfacet", int_ior=1.006),
    "a reflection that is drawn once in 40,000 samples": case("deltas", "dielectric", int_ior=1.01),
    "glass that is dusty": case(
        "mode",
        "blendbsdf",
        weight=0.3,
        glass={"type": "dielectric"},
        dust={"type": "twosided", "a": {"type": "diffuse"}},
    ),
    "a faint one over a diffuse one": case("deltas", "plastic", specular_reflectance=2e-4),
    "tints": case("colours spectral", "burley", sheen=1.0, sheen_tint=1.0, spec_tint=1.0, base_color=0.5),
    "a lobe opposite to the normal": case("pdf chi2", "lafortune", 0, cz=-1.5, exponent=0.0, diffuse_reflectance=0.2),
    "a narrow lobe far below the horizon": case(
        "pdf chi2", "lafortune", cx=1.5, cy=-1.5, cz=-1.5, exponent=11546.6, normalization="none"
    ),
    "a narrow lobe just below the horizon": case("pdf", "lafortune", cx=-1.5, cy=0.3, cz=-0.05, exponent=1e5),
    "an index at the low end of its range": case("colours spectral", "cooktorrance", eta=0.01, k=3.0),
    "a limit on both sides": case("gradients", "twosided", inner={"type": "walter"}),
    "facets of no index, under no film": case(
        "flags", "cooktorrance", int_ior="water", ext_ior="water", distribution="blinn", film_thickness=0.0
    ),
    "facets smoother than those of a page": case("gradients", "burley", roughness=0.014, anisotropic=0.5),
    "bright facets whose width has no influence": case(
        "gradients",
        "low",
        a=9479.267547218811,
        b=1e6,
        c=0.0,
        int_ior=44.895,
        variant="microfacet",
        normalization="unit",
    ),
    "two lobes, both black": case(
        "components", "microfacet", diffuse_reflectance=0.0, int_ior="water", ext_ior="water"
    ),
    "a highlight beside a bitmap in colours": case(
        "spectral", "phong", exponent=1e6, normalization="energy", diffuse_reflectance=texels(False)
    ),
}
ALL_PASS = {
    "minnaert 8": case("continuity", "minnaert", exponent=8.0),
    "a narrow lobe at grazing": case("continuity", "microfacet", preset="low/ashikhmin-shirley-e1/white-marble"),
    "wrap 8": case("continuity", "wrap", exponent=8.0, wrap=0.0),
    "lafortune cz = 1": case("continuity", "lafortune", cx=0.0, cy=0.0, cz=1.0, exponent=8.0),
    "lafortune anisotropic": case("flags", "lafortune", cx=-0.9, cy=-0.3, cz=1.0),
    "eta of 1": case("gradients", "roughconductor", eta=1.0, k=0.0),
    "int_ior of 1": case("gradients", "microfacet", int_ior=1.0, ext_ior=1.0),
    "int_ior of air": case("gradients", "microfacet", int_ior=1.0),
    "total reflection": case("gradients", "roughconductor", eta=0.8, k=0.0),
}
"""Powers of the height above the horizon, an index of refraction of one, and what is black until a parameter changes:
each finding passes, and none is skipped."""


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[] if name in ("many turns", "minnaert 8", "eta of 1") else pytest.mark.slow)
        for name in FALSE_ALARMS | ALL_PASS
    ],
)
def test_no_false_alarm(name, monkeypatch):
    asked, given = (FALSE_ALARMS | ALL_PASS)[name]
    if asked["angles"] is not ANGLES:
        look_at_few_directions(monkeypatch)
    report = check(given, **asked)
    assert not report.failures and report.judged, report
    if name in ALL_PASS:
        assert {finding.verdict for finding in report.findings if finding.subject != "wi and wo"} == {"pass"}, report


def halves(wi, wo):
    return dr.select(wi.x * wo.x > 0, 1, 0.2)


def glints(wi, wo):
    cell = dr.floor(40 * dr.normalize(wi + wo))
    return dr.select(((mi.Int(cell.x) + mi.Int(cell.y)) & 1) == 0, 1, 0.2)


@pytest.mark.parametrize("pattern", [halves, glints])
def test_patterns_that_jump_everywhere_do_not_jump_at_the_normal(pattern):
    (finding,) = check(Mutant("pattern", (), diffuse(pattern)).register(), only="continuity").findings
    assert finding.verdict == "pass" and "At other directions it jumps, too" in finding.message, finding


@pytest.mark.slow
def test_a_colour_as_a_texture_of_spectra():
    """It is not given by the coefficients that a constant one has."""
    mi.set_variant("llvm_ad_spectral")
    report = check({"type": "orennayar", "reflectance": {"type": "rgb", "value": (0.2, 0.3, 0.8)}}, only="textures")
    assert not report.failures and {finding.subject for finding in report.findings} == {"reflectance", "sigma"}


@pytest.mark.slow
def test_bitmaps_are_not_used_up():
    """Spectral variants write into those that they are given."""
    mi.set_variant("llvm_ad_spectral")
    bitmap = mi.Bitmap(np.random.default_rng(3).uniform(0.1, 0.9, (4, 4, 3)).astype(np.float32))
    before = np.array(bitmap)
    report = check(
        {"type": "lambert", "reflectance": {"type": "bitmap", "bitmap": bitmap}}, only=["spectral", "updates"]
    )
    assert not report.failures and (np.array(bitmap) == before).all()


def test_colours_are_those_of_rgb_variants():
    """In others a parameter is the coefficients of a spectrum, of which no colour can be made."""
    mi.set_variant("llvm_ad_spectral")
    colour = {"type": "rgb", "value": (0.51, 0.66, 0.82)}
    assert check({"type": "lambert", "reflectance": colour}, only="colours").verdict("colours") == "pass"


@pytest.mark.parametrize("colour", [{"type": "rgb", "value": (0.2, 0.5, 0.7)}, texels(False)], ids=["one", "texels"])
@pytest.mark.parametrize("factor", [1.0, 1.5])
def test_derivatives_of_colours_in_spectral_variants(colour, factor):
    """Of the coefficients of a polynomial, of which some are 10⁵ times others."""
    mi.set_variant("llvm_ad_spectral")

    def eval_pdf(self, ctx, si, wo, active=True):
        colour = self.colour.eval(si)
        density = dr.select(active & (si.wi.z > 0) & (wo.z > 0), wo.z * dr.inv_pi, 0)
        return (factor * colour - (factor - 1) * dr.detach(colour)) * density, density

    plain = stranger("plain_colour", DIFFUSE | FRONT, textures={"colour": 0.5}, eval_pdf=eval_pdf)
    verdict = check(plain | {"colour": colour}, only="gradients").verdict("gradients")
    assert verdict == ("pass" if factor == 1 else "fail")


@pytest.mark.parametrize("fault", ["", "exchanged", "grey pairs"])
def test_channels_of_a_colour_that_is_no_texture(fault):
    colour = mi.Color3f(0.5)

    def coloured(self, ctx, si, wo, active):
        lit = active & (si.wi.z > 0) & (wo.z > 0) & ctx.is_enabled(DIFFUSE, 0)
        seen = mi.Color3f(colour.z, colour.y, colour.x) if fault == "exchanged" else colour
        density = dr.select(lit, wo.z * dr.inv_pi, 0)
        return seen * density, density

    def eval_pdf(self, *given):
        value, density = coloured(self, *given)
        return mi.Color3f(mi.luminance(value)) if fault == "grey pairs" else value, density

    def traverse(self, callback):
        callback.put("colour", colour, mi.ParamFlags.Differentiable)

    methods = {"eval": lambda self, *given: coloured(self, *given)[0], "eval_pdf": eval_pdf, "traverse": traverse}
    paint = stranger(f"paint_{fault}", DIFFUSE | FRONT, **methods)
    assert check(paint, only="colours").verdict("colours") == ("fail" if fault else "pass")


def test_a_plugin_of_one_variant():
    """What cannot be loaded elsewhere cannot be judged there. Nor does it have a ``to_string``."""
    report = check(of_others("in_rgb_alone"), only=["spectral", "polarization", "calls"])
    assert [finding.verdict for finding in report.findings] == ["skip", "skip", "pass"], report
    for finding, variant in zip(report.findings, ("spectral", "spectral_polarized"), strict=False):
        words = f'It does not work in llvm_ad_{variant}: nobody has registered the plugin "in_rgb_alone" there.'
        assert finding.message == words


@pytest.mark.slow
def test_parameters_that_are_no_numbers():
    """Nor any numbers at all."""

    matrix, nothing = mi.Matrix3f(1), mi.Float()

    def traverse(self, callback):
        callback.put("matrix", matrix, mi.ParamFlags.Differentiable)
        callback.put("nothing", nothing, mi.ParamFlags.Differentiable)

    odd = of_others("odd", side=-1, traverse=traverse)
    report = check(odd, only=["gradients", "updates", "recompiles", "reflectance"])
    assert not report.failures, report


def test_a_bsdf_without_components_fails():
    """Nothing of it could be judged."""

    def begin(self, props):
        self.m_components = []

    (finding,) = check(stranger("forgetful", DIFFUSE | FRONT, begin=begin), only="pdf").findings
    assert finding.verdict == "fail" and "m_components" in finding.message


@pytest.mark.slow
def test_negative_channels_that_a_page_announces():
    """Those of RGL's colours outside sRGB, which ``measured`` renders, too."""
    (finding,) = check(str(shared("rgl", "chm_mint_rgb.bsdf")), only="finite").findings
    assert finding.verdict == "pass" and finding.message.endswith("Channels may be negative, as its page says.")


def test_one_fault_is_one_sentence():
    """A density that is too low makes weights too large: that is no gain of energy."""
    low = changed(LambertLobe, density=lambda wi, wo: mi.Float(0.8))
    report = check(Mutant("low", (), lambert(low), given=(("reflectance", 0.95),)).register(), only=["pdf", "albedo"])
    assert {finding.check for finding in report.failures} == {"pdf"}
    (skipped,) = (it for it in report.findings if it.check == "albedo")
    assert skipped.verdict == "skip" and skipped.message.startswith("Not judged: mend pdf and chi2 first")


@pytest.mark.parametrize(
    ("name", "only"),
    [
        ("weight at most one", "textures"),
        ("not a number at grazing", "components"),
        ("negative at grazing", "weight mode components"),
    ],
)
def test_other_checks_leave_a_fault_to_its_own(name, only):
    (mutant,) = (it for it in MUTANTS if it.name == name)
    report = check(mutant.register(), only=only.split(), angles=(60,))
    assert report.passed and "could not be checked" not in str(report), report


def test_arguments_that_are_wrong_or_short():
    assert check("lambert", only="finite", angles=30).passed
    assert check("ngan/ward/blue-acrylic", only="finite").passed
    with mi.variant_context("scalar_rgb"):
        other = mi.load_dict({"type": "ward"})
    for bsdf in (["ward"], {}, {"type": 5}, [], None, 3, {"type": "sphere"}, other, "scenes/first_light.xml"):
        with pytest.raises(ValueError, match=r"no BSDF|not a BSDF|materials; name one"):
            check(bsdf, only="finite")
    for bsdf, sentence in (
        ("wrad", '^there is no plugin "wrad"; did you mean "ward"[?]$'),
        ({"type": "ward", "alpa": 1}, "^ward: unknown parameter alpa; did you mean alpha[?].*$"),
        ({"type": "ward", "alpha": "x"}, '^ward: alpha = "x" is a string; .*$'),
    ):
        with pytest.raises(ValueError, match=sentence):
            check(bsdf, only="finite")
    for wrong in ({"angles": "30"}, {"angles": [None]}, {"significance": "x"}, {"only": 3}, {"only": "finit"}):
        with pytest.raises(ValueError, match=r"\.$|there are finite"):
            check("lambert", **wrong)


def test_the_density_of_roughplastic_goes_below_the_horizon():
    """A fault of Mitsuba 3.9's: its pdf is not cut off at the horizon, and negative there."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        assert "raised" not in str(check({"type": "roughplastic"}, only="chi2", angles=60))
    only = ["horizon", "finite", "weight", "eval_pdf", "support", "components"]
    report = check({"type": "roughplastic"}, only=only, angles=60)
    assert {finding.check for finding in report.failures} == {"horizon", "finite"}
    assert all("pdf is" in finding.message for finding in report.failures)


@pytest.mark.slow
def test_directions_beside_those_asked_for_are_looked_at():
    """With Beckmann's distribution Mitsuba approximates the masking in its density: at 82°, by 0.3 %."""
    (finding,) = check({"type": "roughconductor"}, only=["pdf"], angles=60).failures
    assert "for light from θ = 81" in finding.message and "more like it" not in finding.message
    assert check({"type": "roughconductor"}, only=["pdf"], angles=(82,)).failures[0].data["82°"]["integral"] < 0.97


@pytest.mark.slow
def test_refraction(monkeypatch):
    """A rough dielectric, whose samples lie on both sides, seen from both."""
    look_at_few_directions(monkeypatch)
    only = ["finite", "horizon", "support", "eval_pdf", "flags", "components", "pdf", "chi2"]
    report = check({"type": "roughdielectric", "alpha": 0.3, "distribution": "ggx"}, only=only, angles=60)
    assert not [finding for finding in report.failures if finding.subject == "whole"], report


def test_the_way_to_directions_may_follow_the_tangent():
    """As in ``bumpmap``, where values and densities stay when the surface is turned in the world."""
    heights = 0.05 * np.random.default_rng(1).random((8, 8, 1), np.float32)
    bumps = {"type": "bitmap", "raw": True, "bitmap": mi.Bitmap(heights)}
    assert check({"type": "bumpmap", "bumps": bumps, "bsdf": {"type": "diffuse"}}, only=["calls"]).passed


def test_kinks_have_the_derivatives_of_both_sides():
    """The largest of the lobe's three factors, which are equal by default, scales it."""
    report = check({"type": "lafortune"}, only=["gradients"])
    assert report.passed and len(report.findings) == 7, report


@pytest.mark.slow
def test_delta_functions_beside_others_are_skipped():
    mixed = check({"type": "plastic"}, only=["chi2", "pdf", "weight"], angles=(30,))
    assert mixed.passed and [finding.verdict for finding in mixed.findings] == ["skip", *["pass"] * 6]


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        ("", ""),
        ("light", "but 0.04017 where only these are drawn"),
        ("density", "state the density "),
        ("direction", "if it turned with the light: it is not flagged anisotropic"),
    ],
)
def test_delta_functions_beside_others_are_judged_by_their_samples(fault, told):
    """Of a mirror over a diffuse surface: what it carries among others, how often it is drawn, and where to."""

    def sample(own, ctx, *given):
        bs, weight = own(ctx, *given)
        of_mirror = bs.sampled_component == 0
        if fault == "light" and ctx.component != 0:
            weight *= dr.select(of_mirror, bs.pdf, 1)
        if fault == "density":
            bs.pdf *= dr.select(of_mirror, mi.Float(2), 1)
        if fault == "direction":
            bs.wo.y *= dr.select(of_mirror, mi.Float(-1), 1)
        return bs, weight

    polish = wrapped("polish", {"type": "plastic"}, sample=sample)
    report = check(polish, only=["components", "deltas", "flags"], angles=30)
    found = {(it.check, it.subject) for it in report.failures}
    assert found == ({("deltas", "component 0 (delta reflection)")} if fault else set()), report
    assert told in str(report)


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        ("", ""),
        ("eta of the other way", "the sine of a sample's angle"),
        ("bright", "it gains energy"),
        ("darker at grazing", "the light of a sample back to wi"),
        ("all reflected", "which goes to the other side"),
        ("diffuse", "sampled_type is 2 for light"),
        ("any type", "leaves it out, where all must be black: active &= ctx.is_enabled(type, 0)"),
        ("from the camera alone", "in the mode Importance a sample's weight"),
        ("inactive", "where active is False, but must be 0"),
        ("values", "but must be 0, as it is a delta function"),
        ("no number", "but must be finite"),
        ("no number", "its albedo is no number: light"),
    ],
)
def test_delta_functions_alone_are_judged_by_their_samples(fault, told):
    """Of the smooth surface of glass."""

    def sample(own, ctx, si, u, v, active):
        if fault == "any type":
            ctx = context(ctx.component)
        if fault == "from the camera alone":
            ctx = context(ctx.component, ctx.type_mask)
        bs, weight = own(ctx, si, u, v, active | (fault == "inactive"))
        kinds, passes = mi.BSDFFlags, bs.sampled_component == 1
        if fault == "eta of the other way":
            bs.eta = dr.select(passes, 1 / bs.eta, bs.eta)
        if fault == "all reflected":
            bs.sampled_type = dr.select(passes, mi.UInt32(int(kinds.DeltaReflection)), bs.sampled_type)
        if fault == "diffuse":
            bs.sampled_type = dr.select(passes, bs.sampled_type, mi.UInt32(int(kinds.DiffuseReflection)))
        if fault == "darker at grazing":
            weight *= abs(si.wi.z)
        return bs, weight * {"bright": 1.05, "no number": dr.nan}.get(fault, 1)

    def value(own, *given):
        return mi.Color3f(0.1 if fault == "values" else 0)

    def pair(own, *given):
        return value(own), mi.Float(0)

    glass = wrapped("glass", {"type": "dielectric"}, sample=sample, eval=value, eval_pdf=pair)
    report = check(glass, only=["albedo", "deltas", "active", "mode", "calls"])
    assert report.passed == (not fault) and told in str([it.data for it in report.failures]) + str(report), report


def test_a_plugin_may_change_its_mask_in_place():
    def sample(own, ctx, si, u, v, active):
        active &= u < 0.5
        return own(ctx, si, u, v, active)

    assert check(wrapped("changed_mask", {"type": "diffuse"}, sample=sample), only="active").passed


@pytest.mark.parametrize("fault", ["", "stripes", "textures", "updates", "colours"])
def test_parameters_of_delta_functions_are_judged(fault):
    """Of a mirror that looks up its reflectance elsewhere, keeps the first one, or exchanges red and green. Stripes of
    its own are no fault."""

    def parameters_changed(self, keys):
        if fault == "updates":
            self.reflectance = mi.load_dict({"type": "rgb", "value": (0.2, 0.3, 0.4)})

    def sample(self, ctx, si, u, v, active=True):
        (bs, lit), at = mirrored(ctx, si, active), mi.SurfaceInteraction3f(si)
        if fault == "textures":
            at.uv = mi.Point2f(si.uv.y, si.uv.x)
        value = self.reflectance.eval(at)
        if fault == "stripes":
            value *= dr.select(dr.sin(20 * si.uv.x) > 0, mi.Float(1), 0.5)
        value = mi.Color3f(value.y, value.x, value.z) if fault == "colours" else value
        return bs, dr.select(lit, value, 0)

    given = {"textures": {"reflectance": 0.8}, "parameters_changed": parameters_changed, "sample": sample}
    mirror = stranger(f"judged_mirror_{fault}", mi.BSDFFlags.DeltaReflection | FRONT, **given)
    report = check(mirror, only=["deltas", "textures", "updates", "colours"])
    assert {it.check for it in report.failures} == {fault} - {"", "stripes"}, report
    verdicts = {it.check: it.verdict for it in report.findings if it.check != "components"}
    assert set(verdicts.values()) <= {"pass", "fail"}, report


@pytest.mark.slow
@pytest.mark.parametrize(("circular", "verdict"), [(0.5, "pass"), (1.5, "fail")])
def test_delta_functions_polarize_no_more_than_fully(circular, verdict):
    """Of a mirror of the intensity and of a part of the circular polarization."""

    def sample(self, ctx, si, u, v, active=True):
        (bs, lit), matrix = mirrored(ctx, si, active), dr.zeros(mi.Spectrum)
        if not mi.is_polarized:
            return bs, dr.select(lit, mi.Spectrum(1), 0)
        matrix[0, 0], matrix[3, 3] = mi.UnpolarizedSpectrum(1), mi.UnpolarizedSpectrum(circular)
        return bs, matrix & lit

    for variant in ("llvm_ad_spectral_polarized", "llvm_ad_rgb"):  # that of the check, and the usual one
        mi.set_variant(variant)
        foil = stranger("foil", mi.BSDFFlags.DeltaReflection | FRONT, sample=sample)
    assert check(foil, only="polarization").verdict("polarization") == verdict


@pytest.mark.slow
def test_masks():
    """They pass as a whole. With a context of one component, Mitsuba's sampler lets all light through."""
    only = [word for word in CHECKS if word not in ("gradients", "recompiles", "continuity", "spectral", "colours")]
    report = check({"type": "mask", "opacity": 0.4, "inner": {"type": "lambert"}}, only=only, angles=(60,))
    part = "component 0 (diffuse reflection)"
    assert {finding.subject for finding in report.failures} == {part, f"{part} masked out", "component 1 (null)"}, (
        report
    )
    judged = {finding.check for finding in report.findings if finding.verdict == "pass" and finding.subject == "whole"}
    assert judged >= {"support", "weight", "pdf", "chi2", "components", "active", "mode"}


@pytest.mark.slow
def test_hair_is_checked_from_all_around():
    """Its parameters include one that is None, and its component for light from behind is a delta function."""
    report = check({"type": "hair"}, angles=(30,), only=["weight", "support", "horizon", "gradients", "efficiency"])
    whole = [finding for finding in report.findings if finding.subject == "whole"]
    assert {finding.verdict for finding in whole} == {"pass", "info"}, report
    assert "30° behind" in next(finding for finding in whole if finding.check == "efficiency").message
    assert not report.failures and report.verdict("gradients") == "pass"


class Raises(Lambert):
    """Fails where a derivative is asked for."""

    def evaluate(self, si, active):
        p = super().evaluate(si, active)
        if dr.grad_enabled(p.reflectance):
            raise TypeError("no derivative.\nAt all")
        return p


def test_fields_that_sample_leaves_empty_are_named():
    report = check(Mutant("empty", (), Lambert, adapted(sample=without_fields)).register(), only=["weight"])
    assert "sample leaves eta empty: begin with dr.zeros(mi.BSDFSample3f)" in report.failures[0].message


def test_what_raises_is_told_and_the_rest_is_checked():
    report = check(Mutant("raises", (), Raises).register(), only=["finite", "gradients", "recompiles", "flags"])
    assert [f.check for f in report.failures] == ["gradients"], report
    assert "raised TypeError: no derivative (test_validation.py, line " in report.failures[0].message
    assert report.verdict("flags") == report.verdict("recompiles") == report.verdict("finite") == "pass"


def test_loaded_bsdfs_and_reports():
    report = check(mi.load_dict({"type": "ward"}), only=["finite", "efficiency"], angles=(45,))
    assert report.name == "Ward" and "passed" in str(report) and "45°" in str(report)
    again = json.loads(json.dumps(report.to_dict()))
    assert again["passed"] and [f["check"] for f in again["findings"]] == ["finite"] * 3 + ["efficiency"] * 3
    assert check(mi.load_dict({"type": "ward"}), only=["finite", "efficiency"], angles=(45,)) == report


@pytest.mark.slow
def test_variants():
    """Spectral variants do; in scalar ones a dict is checked in another, and a loaded BSDF is refused."""
    with mi.variant_context("llvm_ad_spectral"):
        assert check({"type": "walter", "material": "Au", "alpha": 0.3}, angles=60).passed
    with mi.variant_context("scalar_rgb"):
        assert check({"type": "ward"}, only=["weight"]).passed and mi.variant() == "scalar_rgb"
        with pytest.raises(ValueError, match="scalar_rgb cannot be checked"):
            check(mi.load_dict({"type": "ward"}))


# --- The command ----------------------------------------------------------------------------------------------------


run = partial(invoke, "check")


def test_command_reports_verdicts(tmp_path):
    done = run("lambert", "roughplastic", "--only", "horizon", "--only", "weight", "--json", tmp_path / "out.json")
    assert done.exit_code == 1, done.stderr
    lines = done.stdout.splitlines()
    assert lines[:2] == ["lambert: passed", "  pass  horizon, weight"]
    assert lines[2:5] == ["roughplastic: FAILED", "  FAIL  horizon", "  pass  weight"]
    assert lines[5].startswith("  horizon, whole: pdf is ")
    assert [report["passed"] for report in json.loads((tmp_path / "out.json").read_text())] == [True, False]
    assert "2 checked in" in done.stderr


@pytest.mark.slow
def test_command_in_several_processes(tmp_path):
    """The same reports as in one, in the same order, and all of them on one page."""
    given = ["lambert", "wrap", "diffuse", "--only", "pdf", "--only", "weight", "--angles", "30", "--json"]
    several = run(*given, tmp_path / "2.json", "--html", tmp_path / "2.html", "-j", 2)
    one = run(*given, tmp_path / "1.json")
    assert several.exit_code == one.exit_code == 0, several.stderr
    assert several.stdout == one.stdout
    assert (tmp_path / "1.json").read_text() == (tmp_path / "2.json").read_text()
    page = (tmp_path / "2.html").read_text(encoding="utf-8")
    assert page.count("<section") == 3 and page.count("<image") >= 9


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize(
    "sent", [signal.SIGKILL, *(pytest.param(it, marks=pytest.mark.slow) for it in (signal.SIGTERM, signal.SIGINT))]
)
def test_jobs_end_with_the_command(sent):
    """They hold its output open. Ctrl-C, here a signal that only the first of the processes receives, is told of."""
    command = [sys.executable, "-m", "mi_brdfs", "check", "ward", "walter", "-j", "2"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while sum("--multiprocessing-fork" in it.cmdline() for it in psutil.Process(process.pid).children()) < 2:
        time.sleep(0.05)
    process.send_signal(sent)
    stdout, stderr = process.communicate(timeout=20)
    if sent == signal.SIGINT:
        assert (process.returncode, stdout, stderr) == (130, "", "Interrupted; nothing was written.\n")


@pytest.mark.slow
def test_a_job_in_the_background_ignores_ctrl_c():
    """Of a shell, which has it ignore the signal: it is meant for what runs in the foreground."""
    command = [sys.executable, "-m", "mi_brdfs", "check", "lambert", "diffuse", "--only", "pdf", "-j", "2"]
    background = ["sh", "-c", f"trap '' INT; echo; exec {shlex.join(command)}"]
    process = subprocess.Popen(
        background, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    process.stdout.readline()
    while process.poll() is None:
        os.killpg(process.pid, signal.SIGINT)
        time.sleep(0.1)
    stdout, stderr = process.communicate()
    assert process.returncode == 0, stderr
    assert stdout.splitlines() == ["lambert: passed", "  pass  pdf", "diffuse: passed", "  pass  pdf"]
