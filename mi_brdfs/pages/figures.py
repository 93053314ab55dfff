"""Pictures and Matplotlib figures as parts of a page."""

from __future__ import annotations

import re
from base64 import b64encode
from io import BytesIO, StringIO
from itertools import count

import numpy as np

try:
    import matplotlib as mpl
    from markupsafe import Markup
    from matplotlib import colormaps
    from matplotlib.figure import Figure
    from PIL import Image
except ImportError:
    raise ImportError("reports need Jinja2 and Matplotlib: pip install 'mi_brdfs[report]'") from None

from ..plot.style import FAINT, GRID, INK
from ..probe.arrays import Array

SERIES = "#010101", "#020202", "#030303"
"""In place of the page's colours of curves."""
VARIABLES = {INK: "--ink", FAINT: "--faint", GRID: "--line"} | {it: f"--series-{k}" for k, it in enumerate(SERIES, 1)}
DENSITY, DIFFERENCE = colormaps["viridis"], colormaps["RdBu_r"]
"""Legible without telling red from green; the style sheet has them, too."""
QUALITY = 88

_numbers = count()


def data_uri(picture: Array) -> str:
    """Return a picture from 0 to 1 as a link that contains it."""
    stream = BytesIO()
    Image.fromarray(np.round(255 * picture).astype(np.uint8)).save(stream, "WEBP", quality=QUALITY)
    return "data:image/webp;base64," + b64encode(stream.getvalue()).decode()


def svg(figure: Figure) -> Markup:
    """Return a figure as an element: transparent, its inks and series the page's variables, its text text."""
    text = StringIO()
    # Names of definitions are hashes, and must be different in other figures of the page.
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": f"figure {next(_numbers)}"}):
        figure.savefig(text, format="svg", transparent=True, metadata={"Date": None})
    found = text.getvalue()
    found = found[found.index("<svg") :]
    found = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->\n?", "", found, flags=re.DOTALL)
    found = re.sub(r'<g id="[^"]*"', "<g", found)
    found = re.sub(r'<svg[^>]*( viewBox="[^"]*")[^>]*>', r"<svg\1>", found)
    found = found.replace("xlink:href", "href").replace("base64,\n", "base64,")
    for ink, name in VARIABLES.items():
        found = found.replace(ink, f"var({name})")
    return Markup(found)


def brief(value: float) -> str:
    """Return a number with two digits, without an exponent below a million."""
    return f"{float(f'{value:.2g}'):g}"
