"""The explorer: a page in the browser that shows what BSDFs do while their parameters are moved.

``mi-brdfs explore`` opens it; :func:`explore` does so from a notebook, with its server in a process of its own, as two
threads must not call Mitsuba. The plugins themselves are asked for everything that it shows. The page sends its whole
state after each change (:mod:`~mi_brdfs.explorer.state`), through a websocket (:mod:`~mi_brdfs.explorer.server`); one
thread calls Mitsuba and sends what the page does not show yet (:mod:`~mi_brdfs.explorer.session`).
"""

from __future__ import annotations

import json
import subprocess
import sys
from html import escape
from typing import Any
from urllib.parse import quote

from ..mitsuba.registry import presets
from ..probe.sources import is_measured
from .materials import plain
from .state import MEASURED, PRESET, Bsdf

__all__ = ["explore"]


class Page:
    """A page that is shown where a cell of a notebook returns it, until :meth:`close`."""

    def __init__(self, process: subprocess.Popen[str], address: str) -> None:
        self._process, self.address = process, address

    def __repr__(self) -> str:
        return f"<explorer at {self.address}>"

    def _repr_html_(self) -> str:
        return f'<iframe src="{escape(self.address)}" width="100%" height="800" style="border: 0"></iframe>'

    def close(self) -> None:
        """End the server."""
        self._process.terminate()
        self._process.wait()


def explore(*subjects: str | dict[str, Any]) -> Page:
    """Start the explorer, and return its page, which a notebook on this machine shows; elsewhere open its ``address``.

    Its server is another process: models that a notebook registers are not known there. It ends with
    :meth:`~Page.close`, and with the notebook's own process.

    Args:
        subjects: up to four: plugin dicts of numbers, words and colours; or words as ``mi-brdfs explore`` takes them,
            the names of plugins and of published materials, and paths of measured files. By default, ``walter``.

    Raises:
        RuntimeError: if it cannot start, with what it said.
    """
    words = [it for it in subjects if isinstance(it, str) and is_measured(it) and it not in presets()]
    command = [sys.executable, "-m", "mi_brdfs", "explore", "--port", "0", "--no-browser", "--notebook", "--", *words]
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout and process.stderr
    address = process.stdout.readline().strip()
    if not address:
        process.wait()
        raise RuntimeError(process.stderr.read().strip())
    if subjects:
        state = {"subjects": [{"bsdf": _bsdf(it), "name": _name(it)} for it in subjects]}
        address += "#" + quote(json.dumps(state))
    return Page(process, address)


def _bsdf(subject: str | dict[str, Any]) -> Bsdf:
    if isinstance(subject, dict):
        return plain(subject)
    if subject in presets():
        return {"type": PRESET, "name": subject}
    return {"type": MEASURED, "file": subject} if is_measured(subject) else {"type": subject}


def _name(subject: str | dict[str, Any]) -> str:
    return str(subject["type"]) if isinstance(subject, dict) else subject.rpartition("/")[2]
