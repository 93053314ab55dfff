"""Make README.md the project's description, with absolute links once ``project.urls`` in pyproject.toml has a Source:
the package index knows no other files."""

import re
from pathlib import Path

from hatchling.metadata.plugin.interface import MetadataHookInterface

LINK = re.compile(r"(!?)(\[[^\]]*\])\((?!\w+:|#)([^)]+)\)")
"""A relative link, or a picture."""


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
    return LINK.sub(lambda link: f"{link[1]}{link[2]}({source}/{'raw' if link[1] else 'blob'}/HEAD/{link[3]})", text)
