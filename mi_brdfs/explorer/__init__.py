"""The explorer: a page in the browser that shows what BSDFs do while their parameters are moved.

``mi-brdfs explore`` opens it, :func:`explore` does so from a notebook. The plugins themselves are asked for everything
that it shows. The page sends its whole state after each change (:mod:`~mi_brdfs.explorer.state`), through a websocket
(:mod:`~mi_brdfs.explorer.server`); one thread calls Mitsuba (:mod:`~mi_brdfs.explorer.engine`) and sends what the page
does not show yet (:mod:`~mi_brdfs.explorer.session`).
"""

from .notebook import explore

__all__ = ["explore"]
