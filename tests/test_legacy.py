"""Scenes of Mitsuba 0.2 to 0.6, against what 0.6 makes of them, computed here from its rules.

0.6 cannot be installed beside Mitsuba 3, so the rules are restated here: defaults, notations of colours, the scaling of
BSDFs that gain energy, and the formulas in float64 (``reference.py``). Elements of public scenes are retyped as rows of
``ELEMENTS``, with the repository that has them; those with ``-`` show rules that no public scene was found for.
"""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest
import reference
from support import context, direction, hemisphere, interaction, numbers

from mi_brdfs.legacy import load_legacy

UV = 0.375, 0.375
"""The centre of a texel of the pictures, in the second column of four."""
COLUMNS = np.array([(0.2, 0.1, 0.05), (0.8, 0.6, 0.4), (0.3, 0.3, 0.3), (1.0, 0.9, 0.2)])
BITMAP = '<texture type="bitmap"><string name="filename" value="{}"/>{}</texture>'
CHECKS = (
    '<texture type="checkerboard"><spectrum name="color0" value="{}"/><spectrum name="color1" value="{}"/></texture>'
)
SCALE = '<texture type="scale"><float name="scale" value="{}"/>{}</texture>'


def removed(srgb):
    """Linear values of sRGB's."""
    srgb = np.asarray(srgb, float)
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


BYTES = np.round(COLUMNS * 255) / 255
TEXTURES = {
    "picture": (BITMAP.format("picture.exr", ""), COLUMNS[1], COLUMNS.max(axis=0)),
    "bytes": (BITMAP.format("bytes.png", ""), removed(BYTES[1]), removed(BYTES).max(axis=0)),
    "raw": (BITMAP.format("bytes.png", '<float name="gamma" value="1"/>'), BYTES[1], BYTES.max(axis=0)),
    "dim": (SCALE.format(0.717647, BITMAP.format("picture.exr", "")), 0.717647 * COLUMNS[1], 0.717647 * COLUMNS.max(0)),
    "bright": (SCALE.format(1.5, BITMAP.format("picture.exr", "")), 1.5 * COLUMNS[1], 1.5 * COLUMNS.max(axis=0)),
    "checks": ('<texture type="checkerboard"/>', 0.4, 0.4),
    "ten": (CHECKS.format(10, 100), 10, 100),
    "dark": (CHECKS.format(0.1, 0.9), 0.1, 0.9),
    "half": (SCALE.format(0.5, CHECKS.format(0.1, 0.9)), 0.05, 0.45),
}
"""Textures, the values at ``UV``, and the largest of each channel."""

ELEMENTS = """
0.6.0 ward; string variant=ward; float alphaU=.4; float alphaV=.9; spectrum specularReflectance=3; spectrum diffuseReflectance=4 | jfischoff/hs-mitsuba
0.6.0 ward; string variant=ward; float alphaU=1; float alphaV=2; spectrum specularReflectance=3; spectrum diffuseReflectance=4 | jfischoff/hs-mitsuba
0.6.0 ward; float alphaU=.1; float alphaV=.3 | mitsuba-renderer/mitsuba
0.5.0 ward; float alphaU=.1; float alphaV=.3; spectrum diffuseReflectance=0.2; spectrum specularReflectance=0.4 | Ashitaka98/mitsuba
0.5.0 ward; spectrum diffuseReflectance=0; rgb specularReflectance=0.61600 0.47520 0.35200; float alpha=0.4 | BlurryLight/Mitsuba0.6_CMakeVcpkg
0.2.0 ward; float diffuseAmount=0; float specularAmount=1; float alphaX=0.1; float alphaY=0.3; spectrum diffuseReflectance=1; spectrum specularReflectance=1 | mitsuba-renderer/mitsuba
0.2.0 ward; float diffuseAmount=0.5; float specularAmount=0.5; float alphaX=0.1; float alphaY=0.3; spectrum diffuseReflectance=1; spectrum specularReflectance=1 | tomka/mitsuba-renderer
0.2.0 ward; string variant=ward; float diffuseAmount=0.8; float specularAmount=0.2; float alphaX=0.1; float alphaY=0.1; rgb diffuseReflectance=0.5, 0.5, 0.5; rgb specularReflectance=0.2, 0.2, 0.2 | the add-on of 0.2 for Blender
0.6.0 phong | mitsuba-renderer/mitsuba
0.6.0 phong; spectrum diffuseReflectance=0.2; spectrum specularReflectance=0.4 | Ashitaka98/mitsuba
0.6.0 phong; float exponent=1; spectrum specularReflectance=2; spectrum diffuseReflectance=3 | jfischoff/hs-mitsuba
0.2.0 phong; float diffuseAmount=0.5; float specularAmount=0.5; spectrum diffuseReflectance=1; spectrum specularReflectance=1 | mitsuba-renderer/mitsuba
0.2.0 phong; float diffuseAmount=.5; float specularAmount=.5; float exponent=20; spectrum diffuseReflectance=1; spectrum specularReflectance=1 | tomka/mitsuba-renderer
0.5.0 phong; string sdmmFilename=phong_4c.sdmm; rgb diffuseReflectance=0.015686 0.015686 0.015686; rgb specularReflectance=9.216 9.216 9.216; float exponent=6000 | anadodik/sdmm-mitsuba
0.5.0 phong; rgb diffuseReflectance=0.023529 0.023529 0.023529; rgb specularReflectance=0.5832 0.5832 0.5832; float exponent=2000 | anadodik/sdmm-mitsuba
0.5.0 phong; rgb diffuseReflectance=0.094118 0.301961 0.431373; rgb specularReflectance=0.5832 0.5832 0.5832; float exponent=1 | anadodik/sdmm-mitsuba
0.5.0 phong; rgb diffuseReflectance=1 0.858824 0.129412; rgb specularReflectance=0.5832 0.5832 0.5832; float exponent=1 | anadodik/sdmm-mitsuba
0.5.0 phong; rgb diffuseReflectance=0 0 0; rgb specularReflectance=1 1 1; float exponent=98 | anadodik/sdmm-mitsuba
0.5.0 phong; rgb diffuseReflectance=0.24 0.24 0.24; rgb specularReflectance=0.59 0.59 0.59; float exponent=54 | anadodik/sdmm-mitsuba
0.5.0 phong; rgb diffuseReflectance=0.7 0.439632 0.1; rgb specularReflectance=0.1 0.1 0.1; float exponent=400.07177 | anadodik/sdmm-mitsuba
0.5.0 phong; rgb diffuseReflectance=0.25 0.3 0.1; rgb specularReflectance=0.025 0.03 0.01; float exponent=20.07177 | anadodik/sdmm-mitsuba
0.5.0 phong; float exponent=256; spectrum specularReflectance=0.1; rgb diffuseReflectance=#ffff6a | anadodik/sdmm-mitsuba
0.5.0 phong; string sdmmFilename=phong_4c.sdmm; ref diffuseReflectance=picture; ref specularReflectance=picture; float exponent=1 | anadodik/sdmm-mitsuba
0.5.0 phong; ref diffuseReflectance=bytes; ref specularReflectance=checks; float exponent=104.601 | anadodik/sdmm-mitsuba
0.5.0 phong; float exponent=256; ref diffuseReflectance=bytes; spectrum specularReflectance=0.1 | hchoi405/dppm-scenes
0.5.0 phong; float exponent=5000; ref diffuseReflectance=picture; spectrum specularReflectance=0.1 | hchoi405/dppm-scenes
0.5.0 phong; float exponent=256; spectrum specularReflectance=0.1; spectrum diffuseReflectance=0.5, 0, 0 | hchoi405/dppm-scenes
0.5.0 phong; float exponent=5000; spectrum specularReflectance=0.2; spectrum diffuseReflectance=0.8 | hchoi405/dppm-scenes
0.5.0 phong; texture diffuseReflectance=dim; rgb specularReflectance=0.027451, 0.027451, 0.027451; float exponent=5.68976 | yysun997/improved-path-guiding
0.5.0 phong; rgb diffuseReflectance=0.992157, 0.992157, 0.992157; rgb specularReflectance=0.0980392, 0.0980392, 0.0980392; float exponent=42.6828 | yysun997/improved-path-guiding
0.5.0 phong; rgb diffuseReflectance=0.01, 0.01, 0.01; rgb specularReflectance=0.603922, 0.639216, 0.372549; float exponent=10.8702 | yysun997/improved-path-guiding
0.5.0 phong; rgb diffuseReflectance=0.941177 0.866667 0.737255; rgb specularReflectance=0.034039 0.032314 0.029333; float exponent=1.07177 | BlurryLight/Mitsuba0.6_CMakeVcpkg
0.5.0 phong; ref diffuseReflectance=checks; rgb specularReflectance=.8,.8,.8; float exponent=100 | luanfujun/Langevin-MCMC
0.5.0 phong; rgb diffuseReflectance=0,0,0; rgb specularReflectance=.8,.8,.8; float exponent=100 | BachiLi/dpt
0.6.0 phong; rgb reflectance=1.0, 1.0, 1.0; float exponent=50 | BachiLi/torrey_public
0.5.0 phong; rgb diffuseReflectance=0.27843 0.27843 0.27843; rgb specularReflectance=1.00000 1.00000 1.00000; float alpha=300.00000 | lzqsd/OptixRenderer
0.5.0 phong; texture diffuseReflectance=bytes; rgb specularReflectance=0.43922 0.43922 0.43922; float alpha=40.00000 | lzqsd/OptixRenderer
0.5.0 phong; float exponent=30.0; srgb specularReflectance=0.2 0.2 0.2; srgb diffuseReflectance=0.5 0.5 0.5 | an exporter of Maya's materials
0.5.0 phong; texture specularReflectance=raw; texture diffuseReflectance=bytes; float exponent=3 | a generator of scenes of cars
0.6.0 roughdiffuse | Ashitaka98/mitsuba
0.6.0 roughdiffuse; float alpha=1 | mitsuba-renderer/mitsuba
0.6.0 roughdiffuse; rgb reflectance=0.5, 0.25, 0.12; float alpha=1.0 | eugenedeon/mitsuba
0.6.0 roughdiffuse; rgb reflectance=1.000, 0.500, 0.000; float alpha=1.0; boolean useFastApprox=true | jfischoff/hs-mitsuba
0.5.0 roughdiffuse; rgb reflectance=0.04 0.04 0.05; float alpha=0.2 | a generator of scenes of cars
0.5.0 roughdiffuse; spectrum reflectance=0.1; float alpha=0.7 | a generator of scenes of cars
0.6.0 Phong | -
0.6.0 WARD; string variant=Ward-Duer | -
0.6.0 ward; float alpha=0.3; float alphaU=0.1 | -
0.6.0 ward; float alphaV=0.4 | -
0.6.0 ward; texture alphaU=checks; float alphaV=0.2 | -
0.6.0 ward; float alpha=0.3; texture alphaV=checks | -
0.6.0 ward; float alpha=1.5 | -
0.6.0 phong; spectrum diffuseReflectance=0.8; spectrum specularReflectance=0.8 | -
0.6.0 phong; spectrum diffuseReflectance=0.8; spectrum specularReflectance=0.8; boolean ensureEnergyConservation=false | -
0.6.0 phong; rgb diffuseReflectance=0.9, 0.1, 0.1; rgb specularReflectance=0.1, 0.9, 0.1 | -
0.6.0 phong; rgb diffuseReflectance=0.9, 0.1, 0.1; rgb specularReflectance=0.3, 0.9, 0.1 | -
0.6.0 phong; spectrum specularReflectance=400:0.1, 700:0.5 | -
0.6.0 phong; srgb diffuseReflectance=#804020 | -
0.6.0 phong; rgb diffuseReflectance=#804020 | -
0.6.0 phong; rgb diffuseReflectance=0.25 | -
0.6.0 phong; spectrum diffuseReflectance=0.1, 0.2, 0.3 | -
0.6.0 phong; texture exponent=ten | -
0.6.0 phong; texture diffuseReflectance=bright | -
0.6.0 phong; texture diffuseReflectance=bright; boolean ensureEnergyConservation=false | -
0.6.0 phong; texture diffuseReflectance=half | -
0.6.0 phong; texture specularReflectance=dark; texture diffuseReflectance=checks | -
0.6.0 phong; spectrum diffuseReflectance=0.9; texture diffuseReflectance=checks | -
0.6.0 phong; float specularSamplingWeight=0.5; float exponent=10; float exponent=20 | -
0.6.0 ward; texture diffuseReflectance=picture; spectrum specularReflectance=0.5; float alpha=0.2 | -
0.6.0 roughdiffuse; rgb diffuseReflectance=0.6, 0.4, 0.2 | -
0.6.0 roughdiffuse; spectrum reflectance=0.2; spectrum diffuseReflectance=0.9 | -
0.6.0 roughdiffuse; spectrum reflectance=0.2; texture diffuseReflectance=checks | -
0.6.0 roughdiffuse; spectrum reflectance=1.5 | -
0.6.0 roughdiffuse; spectrum reflectance=1.5; boolean ensureEnergyConservation=false | -
0.6.0 roughdiffuse; texture alpha=checks; boolean useFastApprox=true | -
0.6.0 roughdiffuse; float alpha=3 | -
"""
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
        rgb = PAIRS[value] if value in PAIRS else [float(v) for v in value.replace(",", " ").split()]
    rgb = np.broadcast_to(removed(rgb) if tag == "srgb" else rgb, 3)
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
        name = "reflectance"
        if "diffuseReflectance" in textures or "reflectance" not in constants | textures:
            name = "diffuseReflectance"
        (rgb,) = scaled(reflectance(name, 0.5))
        sigma = number("alpha", 0.2) / np.sqrt(2)
        fast = constants.get("useFastApprox") == ("boolean", "true")
        model = "qualitative" if fast else "full"
        # Negative values, of the full model near the horizon, are documented to be 0 here.
        return np.stack([np.maximum(reference.orennayar(wi, wo, v, sigma, model), 0) for v in rgb], axis=-1)
    diffuse, specular = scaled(reflectance("diffuseReflectance", 0.5), reflectance("specularReflectance", 0.2))
    if kind == "phong":
        values = [reference.phong(wi, wo, *pair, number("exponent", 30), "energy") for pair in zip(diffuse, specular)]
    else:
        alpha, axes = number("alpha", 0.1), ("X", "Y") if version == "0.2.0" else ("U", "V")
        alphas = [number(f"alpha{axis}", alpha) for axis in axes]
        variant = constants.get("variant", ("string", "balanced"))[1].lower()
        values = [reference.ward(wi, wo, *pair, *alphas, variant) for pair in zip(diffuse, specular)]
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


@pytest.mark.parametrize("row", [row.split("|")[0].strip() for row in ELEMENTS.strip().splitlines()])
def test_values_of_elements(load, row):
    version, kind, properties = split(row)
    referred = dict.fromkeys(value for tag, _, value in properties if tag == "ref")
    scene, warning = load(in_shape(as_xml(kind, properties), referred), version)
    assert ("approximated" in warning) == (row in APPROXIMATED)
    expected = old(*split(APPROXIMATED.get(row, row)), WI.astype(np.float32), WO.astype(np.float32))
    rtol = 1e-3 if any(value in PAIRS for _, _, value in properties) else 1e-4
    np.testing.assert_allclose(evaluated(scene.shapes()[0].bsdf()), expected, rtol, 1e-6)
