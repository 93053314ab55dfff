"""Fits as a page to read. It needs ``pip install 'mi_brdfs[report]'``."""

try:
    import jinja2  # noqa: F401
    import matplotlib  # noqa: F401
    import PIL  # noqa: F401
except ImportError:
    raise ImportError("reports need Jinja2 and Matplotlib: pip install 'mi_brdfs[report]'") from None

from .page import Page

__all__ = ["Page"]
