"""Pictures of the lobes of any BSDF: ``plot.polar({"type": "ward"})`` shows them in a notebook.

:func:`polar` and :func:`cartesian` draw the plane of incidence, :func:`hemisphere` maps all directions, :func:`albedo`
draws the directional albedo. Each takes one BSDF or several to compare, and returns a Matplotlib figure
(``figure.savefig("ward.pdf")``). :func:`measured` draws what measured files hold. They need
``pip install 'mi_brdfs[plot]'``. For a lobe in 3D, see :func:`mi_brdfs.explore`.
"""

try:
    import matplotlib  # noqa: F401
except ImportError:
    raise ImportError("plots need Matplotlib: pip install 'mi_brdfs[plot]'") from None

from .maps import albedo, hemisphere
from .measured import measured
from .planar import cartesian, polar

__all__ = ["albedo", "cartesian", "hemisphere", "measured", "polar"]
