"""The explorer in a notebook: a server in a process of its own, as two threads must not call Mitsuba."""

from __future__ import annotations

import subprocess
import sys
from typing import Any


class Page:
    """A page that is shown where a cell of a notebook returns it, until :meth:`close`."""

    def __init__(self, process: subprocess.Popen[str], address: str) -> None:
        self._process, self.address = process, address

    def _repr_html_(self) -> str:
        return f'<iframe src="{self.address}" width="100%" height="760" style="border: 0"></iframe>'

    def close(self) -> None:
        """End the server."""
        self._process.terminate()
        self._process.wait()


def explore(*targets: str, **parameters: Any) -> Page:
    """Start the explorer and return its page, which a notebook shows.

    Args:
        targets: what ``mi-brdfs explore`` takes: plugins, measured files, published materials; up to four.
        parameters: of all plugins among them, as numbers and words.

    Raises:
        RuntimeError: if it cannot start, with what it said.
    """
    options = [text for name, value in parameters.items() for text in ("-D", f"{name}={value}")]
    command = [sys.executable, "-m", "mi_brdfs", "explore", *targets, *options, "--port", "0", "--no-browser"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout and process.stderr
    address = process.stdout.readline().strip()
    if not address:
        process.wait()
        raise RuntimeError(process.stderr.read().strip())
    return Page(process, address)
