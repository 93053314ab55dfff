"""The one thread that calls Mitsuba: two would crash it."""

from __future__ import annotations

import ctypes
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from queue import SimpleQueue
from typing import Any

import drjit as dr
import mitsuba as mi

from ..mitsuba.errors import one_line
from .session import Session
from .stages import Stages, UserScene
from .views import text

RELEASE = 1.0
"""The seconds after which memory that is free is given back, as edits of any size leave it in pieces."""


class Engine(threading.Thread):
    """Serves all sessions in turn, a step of each."""

    def __init__(self, variant: str, user: UserScene) -> None:
        super().__init__(name="mi_brdfs explorer", daemon=True)
        self.variant = variant
        self.stages = Stages(user)
        self.sessions: list[Session] = []
        self._wake = threading.Event()
        self._ended = False
        self._calls: SimpleQueue[tuple[Callable[[], Any], Future]] = SimpleQueue()

    def wake(self) -> None:
        """Say that a session has something new."""
        self._wake.set()

    def call(self, function: Callable[[], Any]) -> Future:
        """Call a function in this thread, between two steps."""
        future: Future = Future()
        self._calls.put((function, future))
        self.wake()
        return future

    def end(self) -> None:
        """End the thread after the step at work."""
        self._ended = True
        self.wake()

    def run(self) -> None:
        mi.set_variant(self.variant)
        released = time.monotonic()
        while not self._ended:
            while not self._calls.empty():
                _run(*self._calls.get())
            worked = [self._step(session) for session in list(self.sessions)]
            self.sessions = [session for session in self.sessions if not session.closed]
            if not any(worked):
                self._wake.wait(0.05)
            elif time.monotonic() - released > RELEASE:
                _release_memory()
                released = time.monotonic()
            self._wake.clear()

    def _step(self, session: Session) -> bool:
        try:
            return session.step()
        except Exception as error:
            session.send(text(type="error", text=one_line(error)))
            return True


def _run(function: Callable[[], Any], future: Future) -> None:
    try:
        future.set_result(function())
    except Exception as error:
        future.set_exception(error)


def _release_memory() -> None:
    """Return memory that Dr.Jit and the C library keep for later to the system. (glibc does not by itself: in half an
    hour of edits, a server grew by 85 MB without a leak.)"""
    dr.flush_malloc_cache()
    with suppress(AttributeError, TypeError, OSError):  # another C library has no such call
        ctypes.CDLL(None).malloc_trim(0)
