"""Generate README.md's table of models, and its results of ``mi-brdfs bench --json docs/bench.json``."""

from __future__ import annotations

import json
import re

from mi_brdfs.bench import Results

from .made import ROOT, Page
from .models import model_table

MEASURED = ROOT / "docs" / "bench.json"
README = ROOT / "README.md"


def page() -> Page:
    return Page(README, text)


def text() -> str:
    """Return the text of README.md with its generated parts renewed."""
    results = Results.from_dict(json.loads(MEASURED.read_text(encoding="utf-8")))
    readme = README.read_text(encoding="utf-8")
    for name, part in (("models", model_table()), ("bench", results.markdown())):
        place = re.compile(rf"(?<=<!-- {name} -->\n).*?(?=<!-- end of {name} -->)", re.DOTALL)
        readme, places = place.subn(lambda _, part=part: f"\n{part}\n", readme)
        if places != 1:
            raise ValueError(f"README.md has no place between <!-- {name} --> and <!-- end of {name} -->.")
    return readme
