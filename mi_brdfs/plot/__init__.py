"""Pictures of the lobes of any BSDF: ``plot.polar({"type": "ward"})`` shows them in a notebook.

:func:`polar` and :func:`cartesian` draw the plane of incidence, :func:`hemisphere` maps all directions, :func:`albedo`
draws the directional albedo, and :func:`sphere` the lobe as a body to turn with the mouse. Each takes one BSDF or
several to compare, and returns a Matplotlib figure (``figure.savefig("ward.pdf")``) or, in the case of :func:`sphere`,
a Plotly figure (``figure.write_html("ward.html")``). :func:`measured` draws what measured files hold. They need
``pip install 'mi_brdfs[plot]'``.
"""

try:
    import matplotlib  # noqa: F401
except ImportError:
    raise ImportError("plots need Matplotlib: pip install 'mi_brdfs[plot]'") from None

from .maps import albedo, hemisphere
from .measured import measured
from .planar import cartesian, polar
from .sphere import sphere

__all__ = ["albedo", "cartesian", "hemisphere", "measured", "polar", "sphere"]
