"""Ctrl-C and SIGTERM where an exception does not do: while the command ``mi-brdfs`` starts, and in imports."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path


class Terminated(SystemExit):
    """SIGTERM was received."""


def prepare_command() -> None:
    """In the command's process, let Ctrl-C end it in a sentence, and end it if its folder is gone: the compiled modules
    that are imported first make any exception of Ctrl-C, or none, and abort in such a folder."""
    words = sys.orig_argv  # of this process; the others of a pool have sys.argv, too
    is_command = Path(sys.argv[0]).stem == "mi-brdfs" and sys.argv[0] in words
    is_module = ("-m", "mi_brdfs") in pairwise(words)
    if not (is_command or is_module):
        return
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)
    try:
        os.getcwd()
    except OSError:
        sys.exit("mi-brdfs: the working folder is gone; change to one that is there")


def raise_on_ctrl_c() -> None:
    """Let Ctrl-C raise KeyboardInterrupt again, for a command that has begun."""
    if signal.getsignal(signal.SIGINT) is _end:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def exit_on_sigterm() -> None:
    """Let SIGTERM raise an exception, so that nothing is left of what is half written."""
    if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, _exit)


@contextmanager
def signals_held() -> Iterator[None]:
    """Let Ctrl-C and SIGTERM wait until the end: imports that they interrupt make other errors of them, and processes
    that start print tracebacks."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    handlers = {number: handler for number, handler in handlers.items() if callable(handler)}
    if threading.current_thread() is not threading.main_thread():
        yield  # they do not interrupt
        return
    received: list[int] = []
    for number in handlers:
        signal.signal(number, lambda number, _: received.append(number))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    if received:
        signal.raise_signal(received[0])


def _exit(number: int, _: object) -> None:
    signal.signal(number, signal.SIG_IGN)  # `timeout` sends it twice
    raise Terminated(128 + number)


def _end(*_: object) -> None:
    os.write(2, b"Interrupted; nothing was written.\n")
    os._exit(130)
