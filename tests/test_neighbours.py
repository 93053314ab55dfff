"""Models beside other parts of Mitsuba."""

import mitsuba as mi
import numpy as np
import pytest


def picture(bsdf, folder):
    """A square whose vertices have the attributes ``number`` and ``colour``."""
    T = mi.ScalarTransform4f
    mesh = mi.Mesh("square", 4, 2)
    params = mi.traverse(mesh)
    params["vertex_positions"] = [-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0]
    params["faces"] = [0, 1, 2, 0, 2, 3]
    params.update()
    mesh.add_attribute("vertex_number", 1, [0.3] * 4)
    mesh.add_attribute("vertex_colour", 3, [0.2, 0.4, 0.5] * 4)
    mesh.write_ply(str(folder / "square.ply"))
    scene = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 2},
        "sky": {"type": "constant"},
        "sensor": {
            "type": "perspective",
            "to_world": T().look_at([0, -2, 3], [0, 0, 0], [0, 0, 1]),
            "film": {"type": "hdrfilm", "width": 16, "height": 16, "rfilter": {"type": "box"}},
        },
        "square": {"type": "ply", "filename": str(folder / "square.ply"), "bsdf": bsdf},
    }
    scene = mi.load_dict(scene)
    return np.array(mi.render(scene, spp=4, seed=1))


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize(
    "plugin, numbers, colours",
    [("walter", ["alpha"], ["specular_reflectance", "diffuse_reflectance"]), ("burley", ["roughness"], ["base_color"])],
)
def test_attributes_of_meshes_are_parameters(plugin, numbers, colours, tmp_path):
    attribute, colour = {"type": "mesh_attribute"}, {"type": "rgb", "value": [0.2, 0.4, 0.5]}
    of_mesh = dict.fromkeys(numbers, attribute | {"name": "vertex_number"})
    of_mesh |= dict.fromkeys(colours, attribute | {"name": "vertex_colour"})
    uniform = dict.fromkeys(numbers, 0.3) | dict.fromkeys(colours, colour)
    actual, expected, default = (picture({"type": plugin} | given, tmp_path) for given in (of_mesh, uniform, {}))
    np.testing.assert_allclose(actual, expected, atol=1e-5)
    assert abs(default - expected).max() > 0.01


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb")
def test_an_instance_looks_like_the_shape():
    """Turned, so that an anisotropic highlight turns with it."""
    T = mi.ScalarTransform4f
    turn, ball = T().rotate([1, 0, 0], 70), {"type": "sphere", "bsdf": {"type": "ward", "alpha_u": 0.1, "alpha_v": 0.4}}
    common = {
        "type": "scene",
        "integrator": {"type": "path"},
        "lamp": {"type": "point", "position": [2, 4, 6], "intensity": 200.0},
        "sensor": {
            "type": "perspective",
            "fov": 25,
            "to_world": T().look_at([3, 2, 5], [0, 0, 0], [0, 0, 1]),
            "film": {"type": "hdrfilm", "width": 32, "height": 32, "rfilter": {"type": "box"}},
        },
    }
    plain = mi.load_dict(common | {"ball": ball | {"to_world": turn}})
    group = {"type": "shapegroup", "ball": ball}
    instanced = mi.load_dict(
        common
        | {"group": group, "one": {"type": "instance", "to_world": turn, "group": {"type": "ref", "id": "group"}}}
    )
    one, other = (np.array(mi.render(scene, spp=64, seed=3)) for scene in (plain, instanced))
    assert one.max() > 3 * one.mean() > 0
    np.testing.assert_allclose(one, other, rtol=0.02, atol=0.02)
