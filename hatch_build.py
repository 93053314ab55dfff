"""Make README.md the project's description, with absolute links once ``project.urls`` in pyproject.toml has a Source:
the package index knows no other files."""

import re
from pathlib import Path

from hatchling.metadata.plugin.interface import MetadataHookInterface

PICTURE = re.compile(r"(!\[[^\]]*\])\((?!\w+:|#)([^)]+)\)")
LINK = re.compile(r"(\])\((?!\w+:|#)([^)]+)\)")
"""A relative link, maybe around a picture."""


class Description(MetadataHookInterface):
    """The hook that hatchling runs."""

    def update(self, metadata: dict) -> None:
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        if source := metadata.get("urls", {}).get("Source"):
            text = absolute(text, source)
        metadata["readme"] = {"content-type": "text/markdown", "text": text}


def absolute(text: str, source: str) -> str:
    """Return Markdown whose relative links lead to a repository's pages, and pictures to its files, in the way of
    GitHub and GitLab."""
    text = PICTURE.sub(rf"\1({source}/raw/HEAD/\2)", text)
    return LINK.sub(rf"\1({source}/blob/HEAD/\2)", text)
