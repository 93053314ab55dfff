"""Scenes of Mitsuba 0.2 to 0.6, against what 0.6 makes of them, computed here from its rules.

0.6 cannot be installed beside Mitsuba 3, so the rules are restated here: defaults, notations of colours, the scaling of
BSDFs that gain energy, and the formulas in float64 (``reference.py``). Elements of public scenes are retyped as rows of
``rows/legacy.txt``, with the repository that has them; those with ``-`` show rules that no public scene was found for.
"""

from __future__ import annotations

import importlib
import os
import random
import re
import struct
import sys
import time
import zlib
from xml.etree import ElementTree

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
import reference
from support import context, direction, hemisphere, interaction, numbers, rows

from mi_brdfs import load_legacy
from mi_brdfs.legacy import Upgraded, upgrade
from mi_brdfs.rendering.scene_file import SceneFile
from mi_brdfs.srgb import decoded

UV = 0.375, 0.375
"""The centre of a texel of the pictures, in the second column of four."""
COLUMNS = np.array([(0.2, 0.1, 0.05), (0.8, 0.6, 0.4), (0.3, 0.3, 0.3), (1.0, 0.9, 0.2)])
BITMAP = '<texture type="bitmap"><string name="filename" value="{}"/>{}</texture>'
CHECKS = (
    '<texture type="checkerboard"><spectrum name="color0" value="{}"/><spectrum name="color1" value="{}"/></texture>'
)
SCALE = '<texture type="scale"><float name="scale" value="{}"/>{}</texture>'


BYTES = np.round(COLUMNS * 255) / 255
TEXTURES = {
    "picture": (BITMAP.format("picture.exr", ""), COLUMNS[1], COLUMNS.max(axis=0)),
    "bytes": (BITMAP.format("bytes.png", ""), decoded(BYTES[1]), decoded(BYTES).max(axis=0)),
    "raw": (BITMAP.format("bytes.png", '<float name="gamma" value="1"/>'), BYTES[1], BYTES.max(axis=0)),
    "dim": (SCALE.format(0.717647, BITMAP.format("picture.exr", "")), 0.717647 * COLUMNS[1], 0.717647 * COLUMNS.max(0)),
    "bright": (SCALE.format(1.5, BITMAP.format("picture.exr", "")), 1.5 * COLUMNS[1], 1.5 * COLUMNS.max(axis=0)),
    "checks": ('<texture type="checkerboard"/>', 0.4, 0.4),
    "ten": (CHECKS.format(10, 100), 10, 100),
    "white": (CHECKS.format(0.5, 2), 0.5, 2),
    "dark": (CHECKS.format(0.1, 0.9), 0.1, 0.9),
    "half": (SCALE.format(0.5, CHECKS.format(0.1, 0.9)), 0.05, 0.45),
}
"""Textures, the values at ``UV``, and the largest of each channel."""


def as_floats(text):
    return [float(v) for v in text.replace(",", " ").split()]


APPROXIMATED = {
    "0.6.0 roughdiffuse; float alpha=3": "0.6.0 roughdiffuse; float alpha=2.2",
    "0.6.0 roughdiffuse; spectrum reflectance=1.5; boolean ensureEnergyConservation=false":
        "0.6.0 roughdiffuse; spectrum reflectance=1",
    "0.6.0 phong; texture diffuseReflectance=bright; boolean ensureEnergyConservation=false":
        "0.6.0 phong; texture diffuseReflectance=picture; boolean ensureEnergyConservation=false",
}  # fmt: skip
"""Elements that cannot be kept, and those that they become; the report says so."""
# Of equal energy, and 400:0.1, 700:0.9, to 1e-3; integrated with the observer of 1931.
EQUAL, RISING = np.array([1.1998, 0.9495, 0.9036]), np.array([0.8723, 0.4587, 0.1813])
PAIRS = {"400:0.1, 700:0.5": 0.05 * EQUAL + 0.5 * RISING}


def split(row):
    """Version, type and properties (tag, name, value) of a row."""
    head, *rest = row.split("; ")
    version, kind = head.split()
    return version, kind, [(*one.split("=")[0].split(), one.split("=")[1]) for one in rest]


def as_xml(kind, properties):
    """The element of a row."""
    inner = ""
    for tag, name, value in properties:
        if tag == "texture":
            inner += TEXTURES[value][0].replace("<texture", f'<texture name="{name}"', 1)
        elif tag == "ref":
            inner += f'<ref name="{name}" id="{value}"/>'
        else:
            inner += f'<{tag} name="{name}" value="{value}"/>'
    return f'<bsdf type="{kind}">{inner}</bsdf>'


def colour(tag, value):
    """Value and maximum of a colour, in linear RGB."""
    if tag in ("texture", "ref"):
        return [np.broadcast_to(it, 3) for it in TEXTURES[value][1:]]
    if value.startswith("#"):
        rgb = [int(value[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    else:
        rgb = PAIRS[value] if value in PAIRS else as_floats(value)
    rgb = np.broadcast_to(decoded(rgb) if tag == "srgb" else rgb, 3)
    return [rgb, rgb]


def old(version, kind, properties, wi, wo):
    """f cosθ_o of Mitsuba 0.6 for an element, in float64."""
    kind = kind.lower()
    constants = {name: (tag, value) for tag, name, value in properties if tag not in ("texture", "ref")}
    textures = {name: (tag, value) for tag, name, value in properties if tag in ("texture", "ref")}

    def number(name, default):
        given = textures.get(name) or constants.get(name)
        return float(colour(*given)[0].mean()) if given else default

    def reflectance(name, default):
        rgb = colour(*(textures.get(name) or constants.get(name) or ("rgb", str(default))))
        amount = name.replace("Reflectance", "Amount")
        return [it * (number(amount, 1) if version == "0.2.0" else 1) for it in rgb]

    def scaled(*colours):
        largest = sum(maximum for _, maximum in colours).max()
        kept = constants.get("ensureEnergyConservation") == ("boolean", "false") or largest <= 1
        return [value * (1 if kept else 0.99 / largest) for value, _ in colours]

    if kind == "roughdiffuse":
        # Of textures the later one, of constants reflectance.
        given = [name for name in textures if name.endswith("eflectance")]
        name = given[-1] if given else "reflectance" if "reflectance" in constants else "diffuseReflectance"
        (rgb,) = scaled(reflectance(name, 0.5))
        sigma = number("alpha", 0.2) / np.sqrt(2)
        fast = constants.get("useFastApprox") == ("boolean", "true")
        model = "qualitative" if fast else "full"
        # Negative values, of the full model near the horizon, are documented to be 0 here.
        return np.stack([np.maximum(reference.orennayar(wi, wo, v, sigma, model), 0) for v in rgb], axis=-1)
    diffuse, specular = scaled(reflectance("diffuseReflectance", 0.5), reflectance("specularReflectance", 0.2))
    if kind == "phong":
        values = [
            reference.phong(wi, wo, *pair, number("exponent", 30), "energy")
            for pair in zip(diffuse, specular, strict=True)
        ]
    else:
        alpha, axes = number("alpha", 0.1), ("X", "Y") if version == "0.2.0" else ("U", "V")
        alphas = [number(f"alpha{axis}", alpha) for axis in axes]
        variant = constants.get("variant", ("string", "balanced"))[1].lower()
        values = [reference.ward(wi, wo, *pair, *alphas, variant) for pair in zip(diffuse, specular, strict=True)]
    return np.stack(values, axis=-1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the pictures."""
    folder = tmp_path_factory.mktemp("old")
    rows = np.tile(COLUMNS, (4, 1, 1))
    mi.Bitmap(rows.astype(np.float32)).write(str(folder / "picture.exr"))
    mi.Bitmap(np.round(rows * 255).astype(np.uint8)).write(str(folder / "bytes.png"))
    return folder


REST = '<integrator type="path"/><emitter type="constant"/><sensor type="perspective"/>'


@pytest.fixture
def load(folder):
    """Load a scene from the text in it, with what it lacks, and return it with the warning that counts the changes."""

    def load(text, version="0.6.0"):
        path = folder / "scene.xml"
        path.write_text(f'<scene version="{version}">{REST}{text}</scene>')
        with pytest.warns(UserWarning, match="mi-brdfs upgrade") as warned:
            return load_legacy(path), str(warned[0].message)

    return load


def in_shape(bsdf, textures=()):
    """A scene's shape, with textures to refer to before it."""
    ids = "".join(TEXTURES[name][0].replace("<texture", f'<texture id="{name}"', 1) for name in textures)
    return f'{ids}<shape type="rectangle">{bsdf}</shape>'


WO = np.concatenate([hemisphere(9, 1), [direction(0.5, 0.02), direction(0.9, 2.1), direction(1.3, 4)]])
WI = np.concatenate([hemisphere(9, 2), WO[9:] * (-1, -1, 1)])
"""Directions all over the hemisphere, and some at, and near, mirror directions."""
WI[9] = direction(0.52, np.pi)


def evaluated(bsdf, wi=WI, wo=WO):
    """f cosθ_o at ``UV``."""
    pairs = zip(wi.astype(np.float32), wo.astype(np.float32), strict=True)
    return np.array([numbers(bsdf.eval(context(), interaction(i, UV), mi.Vector3f(o))).ravel() for i, o in pairs])


@pytest.mark.parametrize("row", [row.split("|")[0].strip() for row in rows("legacy.txt")], ids=str)
def test_values_of_elements(load, row):
    version, kind, properties = split(row)
    referred = dict.fromkeys(value for tag, _, value in properties if tag == "ref")
    scene, warning = load(in_shape(as_xml(kind, properties), referred), version)
    assert ("approximated" in warning) == (row in APPROXIMATED)
    expected = old(*split(APPROXIMATED.get(row, row)), WI.astype(np.float32), WO.astype(np.float32))
    rtol = 1e-3 if any(value in PAIRS for _, _, value in properties) else 1e-4
    np.testing.assert_allclose(evaluated(scene.shapes()[0].bsdf()), expected, rtol, 1e-6)


def shape(inner):
    return f'<shape type="sphere">{inner}</shape>'


@pytest.fixture
def upgraded(folder):
    """Upgrade a scene from the text in it, and return it with XML on one line."""
    (folder / "rising.spd").write_text("# nm value\n400 0.1\n700 0.9\n")
    (folder / "two.obj").write_text("# two\nmtllib two.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n")
    (folder / "lamp.xml").write_text('<scene version="0.6.0"><emitter type="point"/></scene>')

    def upgraded(text, **options):
        version, text = text.split(" ", 1) if text.startswith("0.") else ("0.6.0", text)
        path = folder / "scene.xml"
        path.write_text(f'<scene version="{version}">{text.replace("<scene/>", "")}</scene>')
        new = upgrade(path, **options)
        return Upgraded(new.version, re.sub(r"\s+(?=<|/>)", "", new.xml), new.changes)

    return upgraded


@pytest.mark.parametrize("row", rows("legacy_upgrades.txt"), ids=str)
def test_what_becomes_of_elements(upgraded, row):
    """Rows have an element of 0.6, or of the version before it, patterns or the numbers of a property of the new XML,
    and parts of the report."""
    old, expected, said = row.split(" =>")
    new = upgraded(re.sub(r"(<bsdf.*)", shape(r"\1"), old) if re.match(r"(0\S+ )?<bsdf", old) else old)
    for it in expected.strip().split("; "):
        name, _, numbers = it.partition(" ~ ")
        if not numbers:
            assert re.search(it, new.xml), new.xml
            continue
        value = re.search(f'name="{name}" value="([^"]*)"', new.xml)[1]
        np.testing.assert_allclose(as_floats(value), as_floats(numbers), 2e-3)
    for words in said.strip().split("; "):
        assert words in new.report()


def given(**properties):
    """Properties, of the type that their values have; a list is a spectrum."""
    tags = {float: "float", int: "integer", bool: "boolean", str: "string", list: "spectrum"}
    values = {name: it[0] if isinstance(it, list) else str(it).lower() for name, it in properties.items()}
    return "".join(f'<{tags[type(it)]} name="{name}" value="{values[name]}"/>' for name, it in properties.items())


SYNTHETIC = [
    f'<integrator type="bdpt">{given(maxDepth=7, rayLength=2.5)}</integrator>',
    f'<sensor type="thinlens">{given(apertureRadius=0.123, kc=0.4)}<sampler type="halton">'
    f'{given(sampleCount=33, scramble=5)}</sampler><film type="ldrfilm">'
    f'{given(tonemapMethod="reinhard", key=0.19, attachLog=True)}<rfilter type="box">{given(radius=0.6)}</rfilter>'
    "</film></sensor>",
    f'<bsdf type="coating" id="a">{given(thickness=1.25, sigmaA=[0.31])}<bsdf type="diffuse"/></bsdf>',
    f'<bsdf type="coating" id="b">{given(specularReflectance=[0.32])}<bsdf type="conductor">{given(x=8.5)}</bsdf>'
    "</bsdf>",
    f'<bsdf type="hk" id="c">{given(thickness=1.33, sigmaS=[0.34])}<phase type="hg">{given(g=0.21)}</phase></bsdf>',
    f'<bsdf type="difftrans" id="d">{given(transmittance=[0.35], y=9.5)}</bsdf>',
    f'<bsdf type="phong" id="e">{given(eta=1.36, exponent=37.5)}{given(exponent=38.5)}</bsdf>',
    f'<bsdf type="roughplastic" id="f">{given(alphaU=0.39)}<texture name="diffuseReflectance" type="gridtexture">'
    f"{given(lineWidth=0.41, color1=[0.42])}</texture></bsdf>",
    f'<bsdf type="mask" id="g"><texture name="opacity" type="bitmap">{given(filename="bytes.png", channel="r")}'
    '</texture><bsdf type="roughdiffuse"/></bsdf>',
    f'<emitter type="sunsky">{given(extend=43, sunRadiusScale=15.5)}</emitter>',
    f'<emitter type="collimated">{given(power=[0.44], samplingWeight=0.45)}</emitter>',
    f'<emitter type="photons">{given(z=46)}</emitter>',
    f'<shape type="sphere">{given(radius=2.25, q=47)}<subsurface type="dipole"/><medium name="interior" '
    f'type="homogeneous">{given(material="milk", strategy=48)}</medium></shape>',
    f'<shape type="instance"><shape type="shapegroup"><shape type="cube">{given(x=2.75)}</shape></shape></shape>',
    f'<shape type="hair">{given(filename="bytes.png", reduction=49)}</shape>',
]
CONVERTED = {"material", "sun_radius_scale", "power", "z", "reduction", "filename", "g"}
"""Names of what is in other units, and of what is in a plugin, here photons, hair, and phase in hk, that is dropped."""


@pytest.mark.parametrize("element", SYNTHETIC)
def test_every_property_is_in_the_new_scene_or_named(upgraded, element):
    new = upgraded(element)
    for tree in ElementTree.fromstring(f"<scene>{element}</scene>").iter():
        name = re.sub("(?<=[a-z])(?=[A-Z])", "_", tree.get("name", "")).lower()
        kept = (f'value="{tree.get("value")}"' if "value" in tree.attrib else f'name="{name}"') in new.xml
        assert not name or name in CONVERTED or kept or re.search(rf"(?<!\w){name}(?!\w)", new.report()), tree.attrib
        assert re.search(rf"\b{tree.get('type', '')}\b", new.xml + new.report()), tree.attrib


@pytest.mark.parametrize("version", ["0.2.0", "0.3.0", "0.5.0", "0.6.0"])
def test_an_upgraded_scene_stays_as_it_is(upgraded, folder, version):
    new = upgraded(f"{version} {''.join(SYNTHETIC)}")
    (folder / "new.xml").write_text(new.xml)
    assert upgrade(folder / "new.xml") == Upgraded("3", new.xml)
    mi.load_string(new.xml.replace("bytes.png", str(folder / "bytes.png")))  # all that is written is known there


@pytest.mark.parametrize("version", ["2.0.0", "2.1.0", "3.0.0", "3.9.1"])
def test_scenes_of_mitsuba_3_are_left_as_they_are(folder, version):
    text = f'<!-- é -->\n<scene version="{version}"><bsdf type="Odd"><float name="alphaU" value="x"/></bsdf></scene>\n'
    (folder / "new.xml").write_text(text, encoding="utf-8")
    assert upgrade(folder / "new.xml") == Upgraded("3", text)


@pytest.mark.parametrize("hour, expected", [(9.0, (0.707, 0.455, 0.542)), (12.0, (0, 0.643, 0.766))])
def test_the_sun_stands_where_it_does(tmp_path, hour, expected):
    """At 50° north, half a day after the sun crossed the equator: in the south at noon, and 45° east of that about the
    celestial axis three hours before. In 0.6 east is X, Y is up, and south Z. Clocks and the sun differ by 1.9°."""
    mi.set_variant("llvm_ad_rgb")
    at = given(latitude=50.0, longitude=0.0, timezone=0.0, hour=hour, year=2012, month=3, day=20)
    path = tmp_path / "sun.xml"
    path.write_text(f'<scene version="0.6.0"><shape type="sphere"/><emitter type="sun">{at}</emitter></scene>')
    with pytest.warns(UserWarning):
        scene = load_legacy(path)
    rng = mi.PCG32(size=1000)
    drawn, light = scene.environment().sample_direction(
        dr.zeros(mi.Interaction3f), mi.Point2f(rng.next_float32(), rng.next_float32())
    )
    towards = np.average(drawn.d.numpy(), axis=1, weights=mi.luminance(light).numpy())
    assert towards / np.linalg.norm(towards) == pytest.approx(expected, abs=0.04)


def test_walls_that_are_turned_inside_out_load_beside_others(load, folder):
    """Mitsuba would merge shapes of equal BSDFs, and fails at these; also where commands load them."""
    wall = '<shape type="rectangle"><bsdf type="diffuse"/>{}</shape>'
    scene, _ = load(wall.format(given(flipNormals=True)) + 2 * wall.format(""))
    with pytest.warns(UserWarning, match="mi-brdfs upgrade"):
        rendered = SceneFile(str(folder / "scene.xml")).load()
    assert len(scene.shapes()) == len(rendered.shapes()) == 3


ROUND = [
    ('<shape type="sphere"><transform name="toWorld"><scale x="-1"/></transform></shape>', (0, 0, 1), (0, 0, 1)),
    ('<shape type="sphere"><boolean name="flipNormals" value="true"/><transform name="toWorld"><scale z="-1"/>'
     "</transform></shape>", (0, 0, 1), (0, 0, -1)),
    ('<shape type="sphere"><point name="center" x="3" y="0" z="0"/><float name="radius" value="0.5"/>'
     '<transform name="toWorld"><scale value="3"/><rotate z="1" angle="90"/><translate z="2"/></transform></shape>',
     (0, 3, 3.5), (0, 0, 1)),
    ('<shape type="cylinder"><transform name="toWorld"><rotate y="1" angle="90"/></transform></shape>', (0, 0, 1),
     (0, 0, 1)),
    ('<shape type="cylinder"><transform name="toWorld"><rotate y="1" angle="90"/><scale y="-1"/></transform></shape>',
     (0, 0, 1), (0, 0, -1)),
]  # fmt: skip


@pytest.mark.parametrize(("shape", "top", "normal"), ROUND)
def test_spheres_and_cylinders_stand_and_face_as_they_did(load, shape, top, normal):
    """A centre is not scaled; a mirrored sphere has its normals outside, and a mirrored cylinder inside."""
    scene, _ = load(shape)
    above = mi.Point3f(top[0] + (0.1 if "cylinder" in shape else 0), top[1], 10)
    hit = scene.ray_intersect(mi.Ray3f(above, mi.Vector3f(0, 0, -1)))
    assert hit.p.numpy().ravel()[2] == pytest.approx(top[2], abs=1e-5)
    np.testing.assert_allclose(hit.n.numpy().ravel(), normal, atol=1e-3)


@pytest.mark.parametrize("reflectance", ["0.5", "0.9, 0.5, 0.2"])
def test_a_coat_over_a_diffuse_base(load, reflectance):
    """Light is refracted in and out once, and not reflected inside."""
    diffuse = f'<bsdf type="diffuse"><rgb name="reflectance" value="{reflectance}"/></bsdf>'
    scene, _ = load(in_shape(f'<bsdf type="coating">{diffuse}</bsdf>'))
    index = 1.5046 / 1.000277
    transmitted = [1 - reference.fresnel_dielectric(w[:, 2], index) for w in (WI, WO)]
    expected = transmitted[0] * transmitted[1] * WO[:, 2] / (np.pi * index**2)
    albedo = np.fromstring(reflectance, sep=",")
    np.testing.assert_allclose(evaluated(scene.shapes()[0].bsdf()), expected[:, None] * albedo * [1, 1, 1], rtol=1e-4)


def test_many_parts_of_a_mixture(load):
    grey = np.linspace(0.1, 0.9, 60)
    weights = np.linspace(0.2, 1, 60) / 36.5
    parts = "".join(f'<bsdf type="diffuse"><spectrum name="reflectance" value="{it}"/></bsdf>' for it in grey)
    mixture = f'<string name="weights" value="{", ".join(map(str, weights))}"/>{parts}'
    scene, _ = load(in_shape(f'<bsdf type="mixturebsdf">{mixture}</bsdf>'))
    cosines = np.repeat(WO[:, 2:], 3, axis=1)
    np.testing.assert_allclose(evaluated(scene.shapes()[0].bsdf()), weights @ grey / np.pi * cosines, rtol=1e-4)


GIVEN = {"eta": [1.5, 0.5, 3.0], "k": [2.0, 3.0, 1.0]}
METALS = {
    "": {"eta": [0.200438, 0.924033, 1.102212], "k": [3.912949, 2.452848, 2.142188]},
    "Au": {"eta": [0.143119, 0.374957, 1.442479], "k": [3.98316, 2.385721, 1.603215]},
    "none": {"eta": [0.0] * 3, "k": [1.0] * 3},
}
"""What 0.6 reads of its materials, copper where none is given, in linear RGB."""


@pytest.mark.parametrize("names", ["", "eta", "k", "eta k"])
@pytest.mark.parametrize("material", METALS)
@pytest.mark.parametrize("kind", ["conductor", "roughconductor", "roughconductor phong"])
def test_conductors_take_the_index_that_is_not_given_from_their_material(load, kind, material, names):
    """Or both, in water, over whose index theirs count. At normal incidence, where a mirror reflects F, and the rough
    ones F D / 4 with D = 1 / (πα²). η of microfacet, which phong becomes, is at least .01."""
    kind, _, distribution = kind.partition(" ")
    indices = {name: GIVEN[name] for name in names.split()}
    words = {"material": material, "distribution": distribution, "extEta": "" if names else "water"}
    inner = "".join(f'<rgb name="{name}" value="{", ".join(map(str, it))}"/>' for name, it in indices.items())
    inner += "".join(f'<string name="{name}" value="{it}"/>' for name, it in words.items() if it)
    scene, _ = load(in_shape(f'<bsdf type="{kind}">{inner}</bsdf>'))
    bsdf, si = scene.shapes()[0].bsdf(), interaction([0, 0, 1])
    if kind == "conductor":
        value = bsdf.sample(context(), si, 0.5, mi.Point2f(0.5))[1]
    else:
        value = bsdf.eval(context(), si, si.wi) * 4 * np.pi * 0.1**2
    eta, k = (np.array((METALS[material] | indices)[name]) / (1 if names else 1.333) for name in ("eta", "k"))
    eta = np.maximum(eta, 0.01 if distribution else 0)
    expected = ((eta - 1) ** 2 + k**2) / ((eta + 1) ** 2 + k**2)
    np.testing.assert_allclose(numbers(value).ravel(), expected, rtol=5e-4)


MISSING = [
    ('<shape type="obj"><string name="filename" value="a.obj"/>{}</shape>', '<shape type="cube">'),
    ('<shape type="obj"><string name="filename" value="C:\\a.obj"/>{}</shape>', '<shape type="cube">'),
    ('<bsdf type="mask"><texture name="opacity" type="bitmap"><string name="filename" value="a.png"/></texture></bsdf>',
     '<rgb name="opacity" value="0.5"'),
    ('<emitter type="envmap"><string name="filename" value="a.exr"/></emitter>', '<emitter type="constant"/>'),
    ('<volume type="gridvolume"><string name="filename" value="a.vol"/></volume>', '<volume type="constvolume">'),
    ('<include filename="a.xml"/>', '<scene version="3.0.0">'),
]  # fmt: skip


@pytest.mark.parametrize("old, stand_in", MISSING)
def test_missing_files(upgraded, old, stand_in):
    old = old.format('<transform name="toWorld"><scale value="2"/></transform><bsdf type="conductor"/>')
    with pytest.raises(ValueError, match=r"^scene.xml:3: there is no (file )?(C:\\)?a\.\w+"):
        upgraded(f"\n\n{old}")
    new = upgraded(old, lenient=True)
    assert stand_in in new.xml
    assert re.search(r"(replaced|dropped): .*a\.\w+", new.report())
    if "cube" in stand_in:
        assert '<scale value="2"/></transform><bsdf type="conductor">' in new.xml


TRIANGLE = [(-1, -1, 0), (1, -1, 0), (0, 1, 0)]


def write_ply(path, properties, vertices, faces):
    lines = ["ply", "format ascii 1.0", f"element vertex {len(vertices)}", *(f"property {it}" for it in properties)]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    lines += [" ".join(map(str, it)) for it in (*vertices, *([3, *face] for face in faces))]
    path.write_text("\n".join([*lines, ""]))


@pytest.mark.parametrize("kind, value, linear", [("uchar", 255, True), ("uchar", 51, False), ("float", 0.2, True)])
def test_colours_of_vertices(load, folder, kind, value, linear):
    """Bytes are parts of 255; colours in sRGB are not decoded, and the report says so."""
    properties = [*(f"float {axis}" for axis in "xyz"), *(f"{kind} {name}" for name in ("red", "green", "blue"))]
    write_ply(folder / "painted.ply", properties, [[*at, *[value] * 3] for at in TRIANGLE], [[0, 1, 2]])
    srgb = '<boolean name="srgb" value="false"/>' * linear
    scene, warning = load(
        f'<shape type="ply"><string name="filename" value="painted.ply"/>{srgb}<bsdf type="twosided">'
        '<bsdf type="diffuse"><texture name="reflectance" type="vertexcolors"/></bsdf></bsdf></shape>'
    )
    si = scene.ray_intersect(mi.Ray3f([0, 0, 2], [0, 0, -1]))
    reflectance = numbers(si.bsdf().eval(mi.BSDFContext(), si, mi.Vector3f(0, 0, 1))).ravel() * np.pi
    np.testing.assert_allclose(reflectance, value / (255 if kind == "uchar" else 1), 1e-5)
    assert f"{1 if linear else 2} approximated" in warning


OCTAHEDRON = np.float32([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
FACES = np.uint32([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])


def octahedron(path, normals):
    """Write one with vertex normals or without, outside of which its faces are seen."""
    if path.suffix == ".serialized":
        flags, name, sizes = 0x1000 | normals, b"octahedron\0", struct.pack("<QQ", len(OCTAHEDRON), len(FACES))
        vertices = OCTAHEDRON.tobytes() * (1 + normals)
        mesh = struct.pack("<HH", 0x041C, 4) + zlib.compress(
            struct.pack("<I", flags) + name + sizes + vertices + FACES.tobytes()
        )
        path.write_bytes(mesh + struct.pack("<QI", 0, 1))
        return
    properties = [f"float {name}" for name in (*"xyz", "nx", "ny", "nz")][: 3 * (1 + normals)]
    write_ply(path, properties, [it * (1 + normals) for it in OCTAHEDRON.tolist()], FACES.tolist())


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("mirror", ["", '<scale x="-1"/>'])
@pytest.mark.parametrize("kind, normals", [("serialized", False), ("serialized", True), ("ply", True), ("cube", None)])
def test_the_inside_of_a_mirrored_shape_stays_inside(load, folder, kind, normals, mirror):
    """As the exterior medium and the front of a BSDF tell."""
    if kind != "cube":
        octahedron(folder / f"octahedron.{kind}", normals)
    file = f'<string name="filename" value="octahedron.{kind}"/>' if kind != "cube" else ""
    scene, _ = load(
        '<medium type="homogeneous" id="air"/>'
        '<medium type="homogeneous" id="fog"><float name="scale" value="2"/></medium>'
        f'<shape type="{kind}">{file}<transform name="toWorld">{mirror}</transform><bsdf type="diffuse"/>'
        '<ref name="exterior" id="air"/><ref name="interior" id="fog"/></shape>'
    )
    si = scene.ray_intersect(mi.Ray3f([0.2, 0.1, 5], [0, 0, -1]))
    assert si.wi.z[0] > 0 and si.target_medium(mi.Vector3f(0, 0, 1))[0].id() == "air"


def test_files_are_found_from_where_a_link_leads(folder, upgraded, tmp_path):
    (tmp_path / "deep").mkdir()
    (folder / "link").symlink_to(tmp_path / "deep", target_is_directory=True)
    new = upgraded(in_shape('<bsdf type="diffuse"><ref id="picture" name="reflectance"/></bsdf>', ["picture"]),
                   folder=folder / "link")  # fmt: skip
    name = re.search(r'value="([^"]*picture\.exr)"', new.xml)[1]
    assert (folder / "link" / name).samefile(folder / "picture.exr")


@pytest.fixture(scope="module")
def opened():
    """What is opened, run and connected to, by Python."""
    seen: list[str] = []
    watching = [True]

    def hook(event, args):
        if watching and event in ("open", "subprocess.Popen", "socket.connect"):
            seen.append(os.path.basename(str(args[0])))

    for module in ("bz2", "gzip", "lzma"):  # which NumPy imports as it opens its first file
        importlib.import_module(module)
    sys.addaudithook(hook)  # which nothing takes out again
    yield seen
    watching.clear()


HOSTILE = {
    "empty": "",
    "no XML": "<scene",
    "two roots": '<scene version="0.6.0"/><scene version="0.6.0"/>',
    "another root": '<bsdf version="0.6.0"/>',
    "version": '<scene version="0.7.0"/>',
    "includes itself": '<scene version="0.6.0"><include filename="scene.xml"/></scene>',
    "cycle": '<scene version="0.6.0"><include filename="cycle.xml"/></scene>',
    "includes a folder": '<scene version="0.6.0"><include filename="."/></scene>',
    "includes a picture": '<scene version="0.6.0"><include filename="bytes.png"/></scene>',
    "bomb": '<!DOCTYPE scene [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;">]><scene version="0.6.0">&b;</scene>',
    "no picture": f'<scene version="0.6.0"><bsdf type="phong">{BITMAP.format("lamp.xml", "")}</bsdf></scene>'.replace(
        "<texture", '<texture name="diffuseReflectance"'
    ),
    "external": '<!DOCTYPE scene [<!ENTITY a SYSTEM "SECRET">]><scene version="0.6.0">&a;</scene>',
    "XInclude": '<scene version="0.6.0" xmlns:i="http://www.w3.org/2001/XInclude"><i:include href="SECRET"/></scene>',
    "undefined entity": '<scene version="0.6.0">&nothing;</scene>',
    "parameters that multiply": '<scene version="0.6.0"><default name="a0" value="hahahahaha"/>'
    + "".join(f'<default name="a{k + 1}" value="{f"$a{k}" * 10}"/>' for k in range(9)) + "</scene>",
    "a parameter of many letters, often": f'<scene version="0.6.0"><default name="a" value="{"x" * 90_000}"/>'
    f'<string name="b" value="{"$a" * 40_000}"/></scene>',
    "no amount": '<scene version="0.2.0"><bsdf type="phong"><float name="diffuseAmount" value=""/></bsdf></scene>',
    "parameter in itself": '<scene version="0.6.0"><default name="a" value="$a"/></scene>',
    "endless spectrum": '<scene version="0.6.0"><bsdf type="diffuse"><spectrum name="reflectance" '
    'filename="/dev/zero"/></bsdf></scene>',
    "deep": '<scene version="0.6.0">' + "<bsdf type='twosided'>" * 5000 + "</bsdf>" * 5000 + "</scene>",
    "long": f'<scene version="0.6.0"><string name="a" value="{"a" * 200_000}"/></scene>',
    "reference to itself": '<scene version="0.6.0"><bsdf type="mask" id="a"><ref id="a"/></bsdf></scene>',
    "alias of itself": '<scene version="0.6.0"><alias id="a" as="a"/><shape type="cube"><ref id="a"/></shape></scene>',
    "encoding": '<?xml version="1.0" encoding="utf-8"?><scene version="0.6.0" author="\xe9"/>'.encode("latin-1"),
    "unknown encoding": '<?xml version="1.0" encoding="klingon"?><scene version="0.6.0"/>',
    "UTF-16": '<?xml version="1.0" encoding="utf-16"?><scene version="0.6.0"/>'.encode("utf-16"),
    "zeros": b'<scene version="0.6.0">\0</scene>',
}  # fmt: skip
NO_SCENES = "", "hello", "<scene version='3.0.0'>", "<bsdf version='3.0.0'/>", "<scene version='abc'/>"
VALUES = ["", "nan", "inf", "-inf", "1e999", "-1", "9" * 400, "1 2 3 4", "word", "0x10", "é", "$missing", "#12345",
          "1:2,", "true", "../../secret", "/", "\u2028", "%s%n", "400:1 300:1", "0"]  # fmt: skip
TYPES = ["diffuse", "phong", "mixturebsdf", "coating", "scale", "bitmap", "sunsky", "homogeneous", "hdrfilm", "odd"]
TAGS = ["bsdf", "texture", "shape", "emitter", "film", "ref", "float", "rgb", "spectrum", "blackbody", "transform",
        "default", "include", "alias", "null", "camera", "odd"]  # fmt: skip


def mutated(seed):
    """A scene with some of its letters, values, types, tags, names and elements changed."""
    some = random.Random(seed)
    old = [re.sub(r"^0\S+ ", "", row.split(" =>")[0]) for row in rows("legacy_upgrades.txt")]
    text = "".join(some.sample(old + SYNTHETIC, 6)).replace("<scene/>", "")
    for _ in range(some.randint(1, 8)):
        kind, new = some.choice([
            (r'(?<= value=")[^"]*', VALUES), (r'(?<= type=")[^"]*', TYPES), (r" \w+=\"[^\"]*\"", ["", ' id="a"']),
            (r'(?<= name=")[^"]*', ["", "alpha", "weights", "filename", "to world", "scale", "reflectance"]),
            (r"(?=<\w)", ["text", "<ref id='a'/>", "<null id='a'/>", "<bsdf/>", "&amp;", "]]>", "<bsdf type='phong'>"]),
            (r"<\w+[^<]*/>", ["", "<spectrum name='reflectance'/>", "<blackbody temperature='-3'/>", "<float/>"]),
        ])  # fmt: skip
        at = some.choice(list(re.finditer(kind, text)) or [re.search("", text)])
        text = text[: at.start()] + some.choice(new) + text[at.end() :]
    text = re.sub(rf"(?<=[</]){some.choice(TAGS)}\b", some.choice(TAGS), text)
    return f'<scene version="{some.choice(["0.2.0", "0.3.0", "0.4.4", "0.6.0"])}">{text}</scene>'


@pytest.mark.parametrize("name", [*HOSTILE, *range(100)])
def test_hostile_scenes_are_upgraded_or_refused_in_a_sentence(folder, opened, name):
    text = HOSTILE[name] if name in HOSTILE else mutated(name)
    secret, path = folder.parent / "secret.txt", folder / "scene.xml"
    secret.write_text("400 1")
    (folder / "cycle.xml").write_text('<scene version="0.6.0"><include filename="scene.xml"/></scene>')
    path.write_bytes(text if isinstance(text, bytes) else text.replace("SECRET", secret.as_uri()).encode())
    opened.clear()
    try:
        new = upgrade(path, lenient=name not in HOSTILE and name % 2 == 0)
    except ValueError as error:
        assert type(error) is ValueError
        assert re.fullmatch(r".*\.(xml|spd|png)\b.*[.)]", str(error)), error
    else:
        assert new.version == "3" or ElementTree.fromstring(new.xml).get("version") == "3.0.0"
    named = {it for it in os.listdir(folder) if it in str(text)}
    assert set(opened) <= named | {"scene.xml"}


@pytest.mark.parametrize("text", NO_SCENES)
def test_what_is_no_scene_is_not_copied(folder, text):
    (folder / "scene.xml").write_text(text)
    with pytest.raises(ValueError, match=r"scene\.xml: (no well-formed XML in UTF|the file has a <\w+> of version)"):
        upgrade(folder / "scene.xml")


def test_files_that_include_others_twice_end(folder):
    (folder / "0.xml").write_text("<scene version='0.6.0'/>")
    for k in range(20):
        twice = f"<include filename='{k}.xml'/>" * 2
        (folder / f"{k + 1}.xml").write_text(f"<scene version='0.6.0'>{twice}</scene>")
    with pytest.raises(ValueError, match="includes more than 1000 files"):
        upgrade(folder / "20.xml")


def test_many_parameters_are_looked_up_once_for_each_use(folder):
    """A comparison of each use with each name, or of all that is left out with each other, takes seconds."""
    names = "".join(f'<default name="p{k}" value="{k}"/>' for k in range(20_000))
    uses = "".join(f'<float name="x{k}" value="$p{k}"/>' for k in range(20_000))
    (folder / "scene.xml").write_text(f'<scene version="0.6.0">{names}<bsdf type="odd">{uses}</bsdf></scene>')
    start = time.process_time()
    assert "x19999" in upgrade(folder / "scene.xml").report()
    assert time.process_time() - start < 4


@pytest.mark.parametrize(
    ("kind", "inside", "sentence"),
    [
        ("phong", given(exponent=float("nan")), "float exponent: 'nan' is not a finite number"),
        ("phong", '<float name="exponent" value="1e999"/>', "float exponent: '1e999' is not a finite number"),
        ("phong", '<boolean name="nonlinear" value="yes"/>', "boolean nonlinear: 'yes' is neither true nor false"),
        ("phong", '<point name="center" x="nan"/>', "point center: 'nan' is not a finite number"),
        ("phong", '<transform><matrix value="1 0 0 0"/></transform>', "matrix: '1 0 0 0' is not 16 finite numbers"),
        ("phong", '<transform><lookat up="0,1"/></transform>', "lookat: '0,1' is not 3 finite numbers"),
        ("conductor", given(eta=[1.5], material="xy"), "'xy' is no metal that Mitsuba knows"),
        ("mixturebsdf", given(weights="-1, .5") + "<bsdf/><bsdf/>", "the weight -1 is negative"),
    ],
)
def test_malformed_values_are_refused_with_the_reason(upgraded, kind, inside, sentence):
    with pytest.raises(ValueError, match=sentence):
        upgraded(f'<bsdf type="{kind}">{inside}</bsdf>')
