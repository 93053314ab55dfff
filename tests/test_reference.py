"""What is generated from the declarations is what the declarations say now."""

import sys
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

from mi_brdfs.registry import all_models

sys.path.insert(0, str(Path(__file__).parents[1] / "docs"))

import reference_page as page

STALE = "stale: run python docs/reference_page.py"


def test_reference_is_current():
    assert page.REFERENCE.read_text(encoding="utf-8") == page.reference(), STALE


def test_readme_lists_the_models():
    assert page.README.read_text(encoding="utf-8") == page.readme(), STALE


def test_one_thumbnail_a_model():
    pictures = {path.stem for path in page.THUMBNAILS.glob("*.png")}
    assert pictures == {model.plugins[0] for model in all_models()}, f"{STALE} all"


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("model", all_models(), ids=lambda model: model.plugins[0])
def test_thumbnail_shows_the_example(model):
    """Rendered anew in a quarter of its size, the picture differs by its noise and by how edges are filtered: by up to
    0.01 on the display's scale from 0 to 1."""
    picture = np.array(mi.Bitmap(str(page.THUMBNAILS / f"{model.plugins[0]}.png")), np.float64) / 255
    now = np.array(page.thumbnail(model, page.SIZE // 4, 256), np.float64) / 255
    small = picture.reshape(page.SIZE // 4, 4, page.SIZE // 4, 4, 3).mean(axis=(1, 3))
    assert abs(small - now).mean() < 0.015, f"{STALE} {model.plugins[0]}"
