"""What the tests of ``shading`` share: its scenes, and plates that fill a picture, of which the shade is known."""

from contextlib import contextmanager
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import mi_brdfs  # noqa: F401
from mi_brdfs.parameters import ParameterError

SCENES = Path(__file__).parents[1] / "scenes" / "shading"
NAMES = [path.stem for path in sorted(SCENES.glob("*.xml"))]

ALBEDO = 0.8
WHITE = {"type": "lambert", "reflectance": ALBEDO}
SUN = {"type": "directional", "direction": [0, 0, -1], "irradiance": 1.0}
SKY = {"type": "constant", "radiance": 0.5}


def load(name, width, height, **defaults):
    """One of the scenes of ``shading``, in some size."""
    return mi.load_file(str(SCENES / f"{name}.xml"), width=str(width), height=str(height), **defaults)


def shaded(scene, **settings):
    """A rendered picture, without NaNs."""
    image = np.array(mi.render(scene, **settings), np.float64)
    assert np.isfinite(image).all()
    return image


def from_above():
    """The camera's place: above the plate, at a distance of 5."""
    return mi.ScalarTransform4f().look_at(origin=[0, 0, 5], target=[0, 0, 0], up=[0, 1, 0])


def film(size=2, **more):
    return {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}, **more}


def plate(bsdf, *others, size=2, tilt=0.0, sensor=None, **settings):
    """A scene of a plate, tilted by some degrees, that fills the picture of an orthographic camera; of lights, and of
    other shapes."""
    scene = {
        "type": "scene",
        "integrator": {"type": "shading", **settings},
        "sensor": sensor or {"type": "orthographic", "to_world": from_above(), "film": film(size)},
        "plate": {
            "type": "rectangle",
            "to_world": mi.ScalarTransform4f().rotate([0, 1, 0], tilt).scale(20),
            "bsdf": bsdf,
        },
    }
    return mi.load_dict(scene | {f"light{k}": other for k, other in enumerate(others)})


def shade(bsdf, *others, spp=1, **settings):
    """The shade of such a plate: the mean of the picture."""
    return shaded(plate(bsdf, *others, **settings), spp=spp).mean()


def lamp(shape, radiance=3.0, to_world=None):
    """An area light, by default at a height of 10."""
    above = mi.ScalarTransform4f().translate([0, 0, 10]).rotate([1, 0, 0], 180)
    return {"type": shape, "to_world": to_world or above, "emitter": {"type": "area", "radiance": radiance}}


def noisy(size=4, **settings):
    """A plate that a bright sky lights, where each sample sees another part of the sky."""
    return plate(WHITE, SKY | {"radiance": 1.2}, size=size, **settings)


@contextmanager
def refused(message):
    """The error that a render has as its cause, of Mitsuba's own."""
    with pytest.raises(RuntimeError) as raised:
        yield
    cause = raised.value
    while cause.__cause__:
        cause = cause.__cause__
    assert isinstance(cause, ParameterError)
    assert message in str(cause)
