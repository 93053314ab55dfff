"""Pictures of the lobes of any BSDF: ``plot.polar({"type": "ward"})`` shows them in a notebook.

:func:`polar` and :func:`cartesian` draw the plane of incidence, :func:`hemisphere` maps all directions, :func:`albedo`
says how much is reflected in all, and :func:`sphere` is the lobe as a body to turn with the mouse. Each takes one BSDF
or several to compare, and returns a figure of Matplotlib (``figure.savefig("ward.pdf")``) or, :func:`sphere`, of Plotly
(``figure.write_html("ward.html")``). They need ``pip install 'mi_brdfs[plot]'``.
"""

from .figures import albedo, cartesian, hemisphere, polar
from .sphere import sphere

__all__ = ["albedo", "cartesian", "hemisphere", "polar", "sphere"]
