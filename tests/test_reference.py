"""What is generated from the declarations is what the declarations say now."""

import sys
from pathlib import Path

from mi_brdfs.mitsuba.registry import all_models

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
