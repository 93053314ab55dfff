"""The one thread that calls Mitsuba: two would crash it."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import Future
from queue import SimpleQueue
from typing import Any

import mitsuba as mi

from ..mitsuba.errors import one_line
from . import stages
from .session import Session
from .state import Bsdf
from .views import text

KEPT = 4
"""Scenes that stay loaded."""


class Engine(threading.Thread):
    """Serves all sessions in turn, a step of each."""

    def __init__(self, variant: str, user: stages.UserScene) -> None:
        super().__init__(name="mi_brdfs explorer", daemon=True)
        self.variant, self.user = variant, user
        self.denoise: Callable | None = stages.denoiser()
        self.sessions: list[Session] = []
        self.problem: str | None = None
        """Why it ended, if that was not asked for."""
        self._wake = threading.Condition()
        self._ended = False
        self._known: set[Any] = set()
        self._stages: OrderedDict[stages.Setting, stages.Stage] = OrderedDict()
        self._calls: SimpleQueue[tuple[Callable[[], Any], Future]] = SimpleQueue()

    def wake(self) -> None:
        """Say that a session has something new."""
        with self._wake:
            self._wake.notify()

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
        while not self._ended:
            while not self._calls.empty():
                _run(*self._calls.get())
            worked = [self._step(session) for session in list(self.sessions)]
            self.sessions = [session for session in self.sessions if not session.closed]
            if not any(worked):
                with self._wake:
                    self._wake.wait(0.05)

    def _step(self, session: Session) -> bool:
        try:
            return session.step(self)
        except Exception as error:
            session.send(text(type="error", text=one_line(error)))
            return True

    def stage(self, setting: stages.Setting) -> stages.Stage:
        """Return the scene of a setting."""
        if setting not in self._stages:
            self._stages[setting] = stages.load(setting, self.user)
            while len(self._stages) > KEPT:
                self._stages.popitem(last=False)
        self._stages.move_to_end(setting)
        return self._stages[setting]

    def is_new(self, bsdf: Bsdf, purpose: Any) -> bool:
        """Return whether kernels for a BSDF of this structure may have to be compiled."""
        words = tuple(sorted((name, it if isinstance(it, (str, bool)) else None) for name, it in bsdf.items()))
        known = (words, purpose) in self._known
        self._known.add((words, purpose))
        return not known


def _run(function: Callable[[], Any], future: Future) -> None:
    try:
        future.set_result(function())
    except Exception as error:
        future.set_exception(error)
