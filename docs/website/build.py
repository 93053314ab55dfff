"""Build the site with Sphinx from the pages of :mod:`website.pages`."""

from __future__ import annotations

import json
import shutil
import sys
import tempfile
from pathlib import Path

from generate.scenes import CARD
from sphinx.application import Sphinx
from sphinx.util.docutils import docutils_namespace, patch_docutils

import mi_brdfs

from . import live
from .pages import questions, summaries, write_pages

HERE = Path(__file__).parent
LOGO = str(HERE / "static" / "logo.svg")
SETTINGS = {
    "project": "mi_brdfs",
    "author": "The mi_brdfs authors",
    "copyright": "the mi_brdfs authors",
    "version": mi_brdfs.__version__,
    "release": mi_brdfs.__version__,
    "extensions": ["myst_parser", "website.finish"],
    "myst_enable_extensions": ["attrs_inline", "colon_fence", "dollarmath"],
    "myst_heading_anchors": 3,
    "html_theme": "furo",
    "html_title": "mi_brdfs",
    "html_static_path": [str(HERE / "static"), str(CARD)],
    "html_logo": LOGO,
    "html_favicon": LOGO,
    "html_theme_options": {
        f"{scheme}_css_variables": {
            "color-brand-primary": accent,
            "color-brand-content": accent,
            "color-brand-visited": accent,
            "plot-filter": plots,
            "plot-blend": blend,
        }
        for scheme, accent, plots, blend in (
            ("light", "#0b5fa5", "none", "multiply"),
            ("dark", "#6db4f2", "invert(1) hue-rotate(180deg)", "screen"),
        )
    },
    "html_css_files": ["site.css"],
    "html_copy_source": False,
    "html_show_sphinx": False,
    "html_permalinks_icon": "#",
    "nitpicky": True,
}


def build(folder: Path) -> int:
    """Build the site into a folder, which is made anew; return the exit status, which is not 0 after a warning."""
    with tempfile.TemporaryDirectory() as scratch, patch_docutils(), docutils_namespace():
        source = Path(scratch) / "source"
        write_pages(source)
        shutil.rmtree(folder, ignore_errors=True)
        live.write_pages(Path(scratch) / "live")
        scorer = Path(scratch) / "scorer.js"
        told = json.dumps({f"reference/{name}": text for name, text in summaries().items()})
        data = f"const SUMMARIES = {told};\nconst QUESTIONS = {json.dumps(questions())};\n"
        scorer.write_text(data + (HERE / scorer.name).read_text(), encoding="utf-8")
        settings = SETTINGS | {"html_extra_path": [str(Path(scratch) / "live")], "html_search_scorer": str(scorer)}
        app = Sphinx(
            source, None, folder, Path(scratch) / "doctrees", "html", settings,
            status=None, warning=sys.stderr, warningiserror=True, keep_going=True,
        )  # fmt: skip
        app.build()
        return app.statuscode
