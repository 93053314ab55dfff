"""The notebooks run, and do what they say."""

import json

import mitsuba as mi
import pytest


@pytest.mark.slow
def test_first_light(pytestconfig):
    notebook = json.loads((pytestconfig.rootpath / "notebooks" / "first_light.ipynb").read_text(encoding="utf-8"))
    cells = {}
    with mi.variant_context("llvm_ad_rgb"):
        for cell in notebook["cells"]:
            if cell["cell_type"] == "code":
                assert not cell["outputs"]
                exec("".join(cell["source"]), cells)
        recovered = {key.split(".")[2]: value.numpy().ravel() for key, value in cells["recovered"].items()}
        assert cells["losses"][-1] < 0.5 * cells["losses"][0]  # what remains is the noise of 16 samples
        assert recovered["specular_reflectance"] == pytest.approx([0.8, 0.5, 0.35], abs=0.08)
        assert recovered["alpha_u"] == pytest.approx(0.08, abs=0.02)
        assert recovered["alpha_v"] == pytest.approx(0.3, abs=0.04)
        assert recovered["diffuse_reflectance"] == pytest.approx(0.05, abs=0.02)
