"""Handling of Ctrl-C."""

from __future__ import annotations

import os
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import active_children

import typer

from ..mitsuba.errors import unwrapped_ctrl_c
from .terminal import Exit, err


@contextmanager
def interruptible() -> Iterator[None]:
    try:
        with unwrapped_ctrl_c():
            yield
    except KeyboardInterrupt:
        err.print("Interrupted; nothing was written.")
        raise typer.Exit(Exit.INTERRUPTED) from None


@contextmanager
def ending_processes() -> Iterator[None]:
    """End the child processes at once after an error or Ctrl-C."""
    try:
        yield
    except BaseException:
        for process in active_children():
            process.terminate()
        raise


@contextmanager
def answer_ctrl_c(announce: Callable[[], None]) -> Iterator[None]:
    """Call ``announce`` as soon as Ctrl-C is pressed, where Python's own handlers wait for the pass to end; a second
    Ctrl-C ends the process."""
    ours, written_by_python = socket.socketpair()
    written_by_python.setblocking(False)

    def watch() -> None:
        pressed = 0
        while received := ours.recv(64):
            pressed += received.count(signal.SIGINT)
            if pressed > 1:
                err.show_cursor(True)
                err.print("Aborted; nothing was written.")
                os._exit(Exit.INTERRUPTED)
            if pressed == 1:
                announce()

    previous = signal.set_wakeup_fd(written_by_python.fileno(), warn_on_full_buffer=False)
    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(previous)
        written_by_python.close()
        watcher.join()
        ours.close()
