"""Generate README.md's table of models."""

from __future__ import annotations

import re

from .made import ROOT, Page
from .models import model_table

README = ROOT / "README.md"
PLACE = re.compile(r"(?<=<!-- models -->\n).*?(?=<!-- end of models -->)", re.DOTALL)


def pages() -> list[Page]:
    return [Page(README, text)]


def text() -> str:
    """Return the text of README.md with its table of models renewed."""
    readme, places = PLACE.subn(lambda _: f"\n{model_table()}\n", README.read_text(encoding="utf-8"))
    if places != 1:
        raise ValueError("README.md has no place between <!-- models --> and <!-- end of models -->.")
    return readme
