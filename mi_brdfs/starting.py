"""Ctrl-C while the command ``mi-brdfs`` starts."""

from __future__ import annotations

import os
import signal
import sys
from itertools import pairwise
from pathlib import Path


def end_on_ctrl_c() -> None:
    """In the command's process, let Ctrl-C end it in a sentence: the compiled modules that are imported first make any
    exception of it, or none."""
    words = sys.orig_argv  # of this process; the others of a pool have sys.argv, too
    is_command = Path(sys.argv[0]).stem == "mi-brdfs" and sys.argv[0] in words
    is_module = ("-m", "mi_brdfs") in pairwise(words)
    if (is_command or is_module) and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)


def raise_on_ctrl_c() -> None:
    """Let Ctrl-C raise KeyboardInterrupt again, for a command that has begun."""
    if signal.getsignal(signal.SIGINT) is _end:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _end(*_: object) -> None:
    os.write(2, b"Interrupted; nothing was written.\n")
    os._exit(130)
