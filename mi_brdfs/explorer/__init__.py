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
import tempfile
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import quote

from ..mitsuba.registry import presets
from ..parameters.messages import brief
from ..probe.sources import is_measured
from .materials import Materials, plain
from .state import MEASURED, PRESET, SUBJECTS, Bsdf, checked

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


def explore(*subjects: str | Path | dict[str, Any]) -> Page:
    """Start the explorer, and return its page, which a notebook on this machine shows; elsewhere open its ``address``.

    Its server is another process: models that a notebook registers are not known there. It ends with
    :meth:`~Page.close`, and with the notebook's own process.

    Args:
        subjects: up to six: plugin dicts of numbers, words and colours; or words as ``mi-brdfs explore`` takes them,
            the names of plugins and of published materials, and paths of measured files. By default, ``walter``.

    Raises:
        ValueError: if there are more, or one is none of these.
        RuntimeError: if it cannot start, with what it said.
    """
    if len(subjects) > SUBJECTS:
        raise ValueError(f"A page shows {SUBJECTS} BSDFs at most, not {len(subjects)}.")
    state = {"subjects": [_subject(it) for it in subjects]}
    words = [it["bsdf"]["file"] for it in state["subjects"] if it["bsdf"]["type"] == MEASURED]
    command = [sys.executable, "-m", "mi_brdfs", "explore", "--port", "0", "--no-browser", "--notebook", "--", *words]
    # What it warns of later has to go somewhere, too, or it would wait.
    with tempfile.TemporaryFile("w+") as told:
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=told, text=True)
        assert process.stdout
        try:
            address = process.stdout.readline().strip()
            if not address:
                process.wait()
                told.seek(0)
                raise RuntimeError(told.read().strip())
        except BaseException:
            process.terminate()
            process.wait()
            raise
    return Page(process, f"{address}#{quote(json.dumps(state))}" if subjects else address)


def _subject(given: str | Path | dict[str, Any]) -> dict[str, Any]:
    """Return what a page knows a BSDF by, or raise a ValueError if it cannot be shown."""
    subject = str(given.absolute()) if isinstance(given, Path) else given
    bsdf: Bsdf
    if isinstance(subject, dict) and isinstance(subject.get("type"), str):
        bsdf, name = plain(subject), subject["type"]
    elif isinstance(subject, str):
        name = subject.rpartition("/")[2]
        if is_measured(subject):
            return {"bsdf": {"type": MEASURED, "file": subject}, "name": name}  # the server knows whether there is one
        bsdf = {"type": PRESET, "name": subject} if subject in presets() else {"type": subject}
    else:
        raise ValueError(
            f"{brief(repr(given))} cannot be shown; give a dict such as {{'type': 'ward'}}, the name of a plugin or of "
            "a published material, or the path of a measured file."
        )
    Materials().expanded(checked(bsdf))
    return {"bsdf": bsdf, "name": name}
