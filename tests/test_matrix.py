"""Every model inside Mitsuba's wrappers of BSDFs, under its integrators, in each kind of variant."""

import itertools

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from support import is_scalar

from mi_brdfs.mitsuba.registry import own_models

NAMES = [model.plugins[0] for model in own_models()]
COMPILED = ["llvm_ad_rgb", "llvm_ad_spectral", "llvm_ad_mono_polarized"]
NOISE = np.random.default_rng(1).uniform(0.1, 0.9, (8, 8, 3)).astype(np.float32)

PATH = {"type": "path", "max_depth": 3}
INTEGRATORS = {
    "path": PATH,
    "prb": {"type": "prb", "max_depth": 3},
    "direct": {"type": "direct"},
    "volpath": {"type": "volpath", "max_depth": 3},
    "aov": {"type": "aov", "aovs": "a:albedo,d:depth,n:sh_normal,p:position,u:uv", "image": PATH},
}
AOVS = 12
"""Channels that the aov integrator puts after the picture's: the albedo's three come first."""


def texture():
    return {"type": "bitmap", "bitmap": mi.Bitmap(NOISE), "raw": True}


# The noise turns normals by 60° in the middle; those of the normal map also away from the camera.
WRAPPERS = {
    "twosided": lambda bsdf: {"type": "twosided", "inner": bsdf},
    "mask": lambda bsdf: {"type": "mask", "opacity": texture(), "inner": bsdf},
    "normalmap": lambda bsdf: {
        "type": "normalmap", "normalmap": texture(), "flip_invalid_normals": False, "inner": bsdf,
    },
    "bumpmap": lambda bsdf: {"type": "bumpmap", "bumps": texture(), "inner": bsdf},
    "blendbsdf": lambda bsdf: {
        "type": "blendbsdf", "weight": texture(), "inner": bsdf,
        "others": {"type": "blendbsdf", "weight": 0.5, "ours": {"type": "lambert"}, "theirs": {"type": "diffuse"}},
    },
}  # fmt: skip


def sphere_pixels():
    """The width of a sphere's picture. What compiled kernels do costs next to nothing."""
    return 8 if is_scalar() else 64


def tray(cells, integrator):
    """A tray of chocolates from above: for each cell, a model's name and a wrapper's, a compartment with two spheres,
    of which the second one is inside out. Walls as high as the spheres let no light pass from one to the next."""
    T, n = mi.ScalarTransform4f, len(cells)
    cardboard = mi.load_dict({"type": "twosided", "inner": {"type": "diffuse"}})
    scene = {
        "type": "scene",
        "integrator": INTEGRATORS[integrator],
        "sensor": {
            "type": "orthographic",
            "to_world": T().look_at([n, 0, 8], [n, 0, 0], [0, 1, 0]).scale([n, n, 1]),
            "film": {
                "type": "hdrfilm",
                "width": n * sphere_pixels(),
                "height": 2 * sphere_pixels(),
                "rfilter": {"type": "box"},
                "pixel_format": "rgb" if mi.is_rgb else "luminance",  # colours outside of RGB's gamut are negative
            },
        },
        "sky": {"type": "constant", "radiance": 0.5},
        "lamp": {"type": "point", "position": [n, -3, 6], "intensity": 20.0},
        "window": {
            "type": "rectangle",
            "to_world": T().look_at([n, 5, 3], [n, 0, 0], [0, 0, 1]).scale([n, 1, 1]),
            "emitter": {"type": "area", "radiance": 2.0},
        },
        "floor": {
            "type": "rectangle",
            "to_world": T().translate([n, 0, -1]).scale([n, 2, 1]),
            "bsdf": cardboard,
        },
    }
    for k in range(n + 1):
        wall = T().translate([2 * k, 0, 0]).rotate([0, 1, 0], 90).scale([1, 2, 1])
        scene[f"wall_{k}"] = {"type": "rectangle", "to_world": wall, "bsdf": cardboard}
    for k, (name, wrapper) in enumerate(cells):
        bsdf = mi.load_dict(WRAPPERS[wrapper]({"type": name}))
        for side, y in [("front", 1), ("back", -1)]:
            scene[f"{name}_{side}"] = {
                "type": "sphere", "center": [2 * k + 1, y, 0], "radius": 0.95, "flip_normals": side == "back",
                "bsdf": bsdf,
            }  # fmt: skip
    return mi.load_dict(scene)


def picture_flaw(column, wrapper, integrator):
    """What is wrong with the picture of a compartment, if anything."""
    if not np.isfinite(column).all():
        return f"{np.sum(~np.isfinite(column).all(axis=-1))} pixels are not finite"
    radiance = column[..., :-AOVS] if integrator == "aov" else column
    if radiance.min() < 0:
        return f"{np.sum((radiance < 0).any(axis=-1))} pixels are negative, down to {radiance.min():.2g}"
    margin = sphere_pixels() // 4
    front, back = (sphere[margin:-margin, margin:-margin] for sphere in np.split(radiance, 2))
    if not front.any() or (wrapper == "twosided" and not back.any()):
        return "is black"
    if integrator == "aov" and not mi.is_spectral:  # a colour from few wavelengths may lie outside of RGB's gamut
        albedo = column[..., -AOVS : 3 - AOVS]
        if albedo.min() < 0 or albedo.max() > 1 + 1e-5:
            return f"albedos reach from {albedo.min():.3g} to {albedo.max():.3g}"
    return None


def flaws(cells, integrator):
    """What is wrong with which cells."""
    try:
        image = np.array(mi.render(tray(cells, integrator), spp=1))
    except Exception as error:
        while error.__cause__:
            error = error.__cause__
        problem = " ".join(str(error).split())
    else:
        columns = np.split(image, len(cells), axis=1)
        found = {cell: picture_flaw(column, cell[1], integrator) for cell, column in zip(cells, columns, strict=True)}
        return {cell: problem for cell, problem in found.items() if problem}
    if len(cells) == 1:
        return {cells[0]: problem}
    alone = {cell: problem for each in cells for cell, problem in flaws([each], integrator).items()}
    return alone or dict.fromkeys(cells, problem)


def check(cells, integrator):
    """Fail with what is wrong with our models; skip what is wrong with ``diffuse`` in the same wrapper, too."""
    found = flaws(cells, integrator)
    if not found:
        return
    theirs = flaws([("diffuse", wrapper) for wrapper in sorted({wrapper for _, wrapper in found})], integrator)
    theirs = {wrapper: problem for (_, wrapper), problem in theirs.items()}
    ours = [
        f"{name} in {wrapper} under {integrator} in {mi.variant()}: {problem}"
        for (name, wrapper), problem in found.items()
        if wrapper not in theirs
    ]
    assert not ours, "\n" + "\n".join(ours)
    pytest.skip(f"diffuse fails as well: {theirs}")


def turns(turn):
    """The cells of all models, turn by turn in another wrapper."""
    wrappers = list(WRAPPERS)
    return [(name, wrappers[(k + turn) % len(wrappers)]) for k, name in enumerate(NAMES)]


@pytest.mark.parametrize(
    "integrator, variant",
    [
        pytest.param(*case, marks=[] if case in (("path", "llvm_ad_rgb"), ("aov", "scalar_rgb")) else pytest.mark.slow)
        for case in itertools.product(INTEGRATORS, [*COMPILED, "scalar_rgb"])
    ],
)
def test_pictures(integrator, variant):
    """Pictures are finite, nonnegative and not black, and albedos in [0, 1].

    Every model is in each wrapper under one integrator, and in another one under each. Compilation takes its time for
    each model, so each of them is in one compiled variant under each integrator, in turn."""
    turn = list(INTEGRATORS).index(integrator)
    cells = turns(turn)
    if variant in COMPILED:
        cells = cells[(COMPILED.index(variant) - turn) % len(COMPILED) :: len(COMPILED)]
    with mi.variant_context(variant):
        check(cells, integrator)


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb")
def test_prb_gradients():
    """The gradients of all parameters are finite, and there are some for each model."""
    cells = turns(0)
    scene = tray(cells, "prb")
    params = mi.traverse(scene)
    keys = {cell: [k for k in params.keys() if k.startswith(f"{cell[0]}_") and k.endswith(".value")] for cell in cells}
    for key in itertools.chain(*keys.values()):
        dr.enable_grad(params[key])
    params.update()
    dr.backward(dr.mean(mi.render(scene, params, spp=1), axis=None))
    for (name, wrapper), own in keys.items():
        gradients = {key: np.array(dr.grad(params[key])) for key in own}
        bad = [key for key, gradient in gradients.items() if not np.isfinite(gradient).all()]
        assert not bad, f"{name} in {wrapper}: no finite gradient of {', '.join(bad)}"
        assert any(gradient.any() for gradient in gradients.values()), f"{name} in {wrapper}: no gradient"
