"""What one page sees: the latest state that it sent, and what of that it has been shown. And the one thread that calls
Mitsuba for all pages: two would crash it.

Nothing is queued: each step looks at the latest state for the first thing that the page has not, so that edits in
between cost nothing.
"""

from __future__ import annotations

import ctypes
import math
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from itertools import chain, count, zip_longest
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import drjit as dr
import mitsuba as mi

from ..mitsuba.errors import one_line
from ..mitsuba.guests import import_models
from ..mitsuba.registry import find_models
from ..rendering.output import encoded
from ..rendering.scene_file import with_material
from . import stages
from .export import page
from .materials import Materials, plain
from .state import EVERY, GIVEN, MEASURED, UPLOAD, Bsdf, State, StateError, key_of
from .views import VIEWS, Frame, frame, packed, text

PAUSE = 0.15
"""The seconds without an edit after which pictures are refined: a pass at work would hold up the next one."""
BACKLOG = 6
"""Frames that wait to be sent, from which on pictures are not refined."""
DENOISED_AT = 2, 6, 16, 64, 256
"""The samples per pixel at which a picture is denoised."""
STARTS = 4
"""The starts of a fit, besides those from published materials."""
RELEASE = 1.0
"""The seconds after which memory that is free is given back, as edits of any size leave it in pieces."""


LOOK = 0.5
"""The seconds after which imported files are looked at again."""


class Disturbed(Exception):
    """The page has changed what it shows, or does not wait for a fit any more."""


class Session:
    """What ``materials`` has, shown in ``scenes``: ``send`` takes frames to the page, and ``waiting`` tells how many of
    them have not arrived. The engine's thread calls :meth:`step`, the server's all others."""

    def __init__(
        self, materials: Materials, scenes: stages.Stages, send: Callable[[Frame], None], waiting: Callable[[], int]
    ) -> None:
        self.materials, self.scenes, self.send, self.waiting = materials, scenes, send, waiting
        self.closed = False
        self._lock = threading.Lock()
        self._latest: tuple[State, int] | None = None
        self._changed: set[int] = set()
        """The places of subjects that were others, or none, in a state since the last step: what was there the page has
        forgotten, even if it is back."""
        self._edited = 0.0
        self._requests: list[Mapping[str, Any]] = []
        self._fits: Iterator[None] | None = None
        self._told: dict[int, tuple[str, bool]] = {}
        """Of each subject its key, and whether it can be shown."""
        self._shown: dict[tuple[str, int], Any] = {}
        self._pictures: dict[int, tuple[Any, stages.Progress]] = {}
        self._sent: dict[int, tuple[Any, int, int]] = {}
        self._idle = True

    # --- The server's side --------------------------------------------------------------------------------------------

    def show(self, state: State, serial: int) -> None:
        """Take a state, in place of the former one."""
        with self._lock:
            former = self._latest[0].subjects if self._latest else []
            places = enumerate(zip_longest(former, state.subjects))
            self._changed |= {k for k, (before, after) in places if before != after}
            self._latest, self._edited = (state, serial), time.perf_counter()

    def ask(self, request: Mapping[str, Any]) -> None:
        """Take a request, or cancel fits. Raise a StateError if the page has not said what it shows."""
        with self._lock:
            if request["type"] == "cancel":
                self._fits = None
                self._requests = [it for it in self._requests if it["type"] != "fit"]
            elif self._latest is None:
                raise StateError("Nothing is shown yet.")
            else:
                self._requests.append(request)

    def close(self) -> None:
        self.closed = True

    def forget(self) -> None:
        """Show all anew, as models have changed. Pictures stay until there are others."""
        self._told.clear()
        self._shown.clear()
        self._pictures.clear()
        self.materials.forget()

    # --- The engine's side --------------------------------------------------------------------------------------------

    def step(self) -> bool:
        """Do the next thing, and return whether there was one."""
        with self._lock:
            latest, request = self._latest, self._requests.pop(0) if self._requests else None
            changed, self._changed = self._changed, set()
        if latest is None or self.closed:
            return False
        for k in changed:
            self._told.pop(k, None)
        state, serial = latest
        if request:
            self._answer(request, state)
            return True
        did = self._tell(state, serial) or self._draw(state, serial)
        if not did and time.perf_counter() - self._edited >= PAUSE:
            did = self._fit_next() | self._refine(state, serial)
        if not did and not self._idle:
            self.send(text(type="idle"))
        self._idle = not did
        return did

    def _tell(self, state: State, serial: int) -> bool:
        """Send the controls of a subject that is new or has changed."""
        for k, given in enumerate(state.subjects):
            key = key_of(given)
            if self._told.get(k, ("", False))[0] != key:
                self._told[k] = key, False
                # What is told anew is drawn anew.
                self._sent.pop(k, None)
                self._shown = {place: shown for place, shown in self._shown.items() if place[1] != k}
                told: dict[str, Any] = {"bsdf": None, "controls": [], "error": None}
                try:
                    bsdf = self.materials.expanded(given)
                    told["bsdf"] = None if key_of(bsdf) == key else bsdf
                    told["controls"] = self.materials.controls(bsdf)
                    told |= self.materials.written(bsdf)
                    told |= self.materials.described(bsdf)
                    self._told[k] = key, True
                except StateError as error:
                    told["error"] = str(error)
                self.send(text(type="subject", serial=serial, subject=k, **told))
                return True
        return False

    def _visible(self, state: State) -> list[tuple[int, str, Bsdf]]:
        """Return the subjects that can be seen, each with its number and key."""
        keys = [key_of(it) for it in state.subjects]
        return [
            (k, key, it)
            for k, (key, it) in enumerate(zip(keys, state.subjects, strict=True))
            if not state.hidden[k] and self._told.get(k) == (key, True)
        ]

    def _draw(self, state: State, serial: int) -> bool:
        """Draw the first thing that is missing: pictures first, but for the very first, which takes longer than all
        curves together."""
        setting = stages.Setting.of(state)
        for view in sorted(state.views, key=lambda view: view == "picture" and not self._pictures):
            for k, key, given in self._visible(state):
                own = (setting, state.exposure) if view == "picture" else (state.component, VIEWS[view].depends(state))
                if self._shown.get((view, k)) == (key, own):
                    continue
                self._shown[view, k] = key, own
                try:
                    self._draw_one(view, k, given, state, serial)
                except (StateError, RuntimeError, ValueError) as error:
                    self.send(text(type="error", text=one_line(error)))
                return True
        return False

    def _draw_one(self, view: str, k: int, given: Bsdf, state: State, serial: int) -> None:
        bsdf, setting = self.materials.expanded(given), stages.Setting.of(state)
        if self.scenes.is_new(bsdf, setting.quick() if view == "picture" else view):
            self.send(text(type="busy", text=f"Compiling {bsdf['type']} …"))
        if view != "picture":
            with self.materials.loaded(bsdf) as loaded:
                self.send(frame(view, loaded, self.materials.data(bsdf), state, serial, k))
            return
        key = key_of(given), setting
        if self._pictures.get(k, (None,))[0] != key:
            progress = self.scenes.progress(setting.quick())
            with self.materials.loaded(bsdf) as loaded:
                progress.advance(loaded)
            self._pictures[k] = key, progress
        self._send_picture(k, state, serial)

    def _refine(self, state: State, serial: int) -> bool:
        """Add a pass to the picture that has the fewest."""
        if "picture" not in state.views or self.waiting() > BACKLOG:
            return False
        setting = stages.Setting.of(state)
        rough = [
            (self._pictures[k][1].spp, k, given)
            for k, key, given in self._visible(state)
            if k in self._pictures and self._pictures[k][0] == (key, setting) and not self._pictures[k][1].finished
        ]
        if not rough:
            return False
        _, k, given = min(rough, key=lambda it: it[:2])
        if self._pictures[k][1].stage is not self.scenes.stage(setting):  # so far it was a quick one
            self._pictures[k] = self._pictures[k][0], self.scenes.progress(setting)
        progress, before = self._pictures[k][1], self._pictures[k][1].spp
        try:
            with self.materials.loaded(self.materials.expanded(given)) as loaded:
                progress.advance(loaded)
        except StateError:
            del self._pictures[k]  # or it would be tried for ever
            raise
        if self.scenes.denoise and any(before < count <= progress.spp for count in DENOISED_AT):
            progress.denoise(self.scenes.denoise)
            self._send_picture(k, state, serial)
        elif not progress.denoised:
            self._send_picture(k, state, serial)
        return True

    def _send_picture(self, k: int, state: State, serial: int) -> None:
        (key, setting), progress = self._pictures[k]
        content = key, replace(setting, size=0), state.exposure
        former, size, spp = self._sent.get(k, (None, 0, 0))
        if content == former and setting.size != size and progress.spp < spp and not progress.finished:
            return  # of another size, but so far no better than what is there
        self._sent[k] = content, setting.size, progress.spp
        payload, header = stages.shown(progress, state.exposure)
        self.send(packed(payload, type="picture", serial=serial, subject=k, final=progress.finished, **header))

    # --- Requests -----------------------------------------------------------------------------------------------------

    def _answer(self, request: Mapping[str, Any], state: State) -> None:
        kind, k = request["type"], request.get("subject", 0)
        try:
            if k >= len(state.subjects):
                raise StateError(f"There is no material {k}.")
            if kind == "chi2":
                self._test(k, state)
            elif kind == "fit":
                self._fit(k, request, state)
            elif request["what"] == "exr":
                self._save_exr(k, state)
            elif request["what"] == "scene":
                self._save_scene(k, state)
            else:
                self._save_page(state, request)
        except (StateError, RuntimeError, ValueError, OSError) as error:
            answer = {"fit": "fitted", "chi2": "chi2"}.get(kind, "error")
            self.send(text(type=answer, subject=k, error=one_line(error), text=one_line(error)))

    def _test(self, k: int, state: State) -> None:
        from ..validation import check

        with self.materials.loaded(self.materials.expanded(state.subjects[k])) as bsdf:
            report = check(bsdf, only=["chi2"], angles=[max(state.theta, 1.0)])
        told = " ".join(dict.fromkeys(f"{it.subject}: {it.sentence}" for it in report.findings))
        self.send(text(type="chi2", subject=k, passed=report.passed, text=told))

    def _fit(self, k: int, request: Mapping[str, Any], state: State) -> None:
        """Begin with fits, in place of others."""
        from ..fit import find_metric, observe

        bsdf = state.subjects[k]
        if bsdf["type"] != MEASURED:
            raise StateError("Only measured files can be fitted.")
        source = self.materials.source(bsdf)
        find_metric(request["metric"])
        chosen = find_models([] if request["model"] == EVERY else [request["model"]])
        self._fits = self._fitting(observe(source.source), [it.plugins[0] for it in chosen], request["metric"])

    def _fit_next(self) -> bool:
        """Go on with the fits, if there are any."""
        fits = self._fits
        if fits and next(fits, True) and self._fits is fits:
            self._fits = None
        return fits is not None

    def _fitting(self, observed: Any, models: list[str], metric: str) -> Iterator[None]:
        """Fit one model after the other, and say how good each is; begin with it anew if the page changes."""
        from ..fit import fit

        own, skipped = self._fits, []
        for past, model in enumerate(models):
            found: dict[str, Any] | None = None
            while found is None:
                edited = self._edited

                def progress(done: int, total: int, past: int = past, edited: float = edited) -> None:
                    if self._edited != edited or self._fits is not own or self.closed:
                        raise Disturbed
                    self.send(text(type="fit", done=past + done / total, total=len(models)))

                try:
                    best = fit(observed, model, metric=metric, starts=STARTS, progress=progress)[0]
                    error = best.held_out if math.isfinite(best.held_out) else None
                    found = {"bsdf": plain(best.bsdf), "model": best.model, "error": error}
                    found["text"] = "\n".join(best.remarks())
                except Disturbed:
                    pass
                except (RuntimeError, ValueError) as error:
                    found = {}
                    skipped.append(one_line(error))
                if found is None:  # not within except, which would keep what was fitted alive
                    yield
            if self._fits is own:  # and is not cancelled
                self.send(text(type="fit", done=past + 1, total=len(models), **found))
            yield
        self.send(text(type="fitted", error=skipped[0] if len(skipped) == len(models) else None))

    def _save_exr(self, k: int, state: State) -> None:
        if k not in self._pictures:
            raise StateError("There is no picture yet.")
        payload = encoded(self._pictures[k][1].bitmap(), "OpenEXR")
        self.send(packed(payload, type="file", name=f"{state.subjects[k]['type']}.exr", mime="image/x-exr"))

    def _save_scene(self, k: int, state: State) -> None:
        """Write the user's scene with a material in it, beside the scene and never over a file."""
        user, bsdf = self.scenes.user, state.subjects[k]
        if user.scene is None:
            raise StateError("There is no scene: start the explorer with --scene FILE.xml.")
        if bsdf["type"] == GIVEN or str(bsdf.get("file", "")).startswith(UPLOAD):
            raise StateError("A scene cannot hold this: it is XML already, or a file that goes with the explorer.")
        xml = self.materials.written(self.materials.expanded(bsdf))["xml"]
        if not xml.startswith("<bsdf"):
            raise StateError(xml.strip("<!- >"))
        replaced = with_material(user.scene, user.material or self.scenes.material, xml)
        stem = f"{user.scene.stem}-{bsdf['type']}"
        for name in (f"{stem}{number}.xml" for number in chain([""], (f"-{n}" for n in count(2)))):
            with suppress(FileExistsError), open(user.scene.with_name(name), "x", encoding="utf-8", newline="") as file:
                file.write(replaced)
                break
        self.send(text(type="written", text=f"Written to {file.name}."))

    def _save_page(self, state: State, request: Mapping[str, Any]) -> None:
        payload = page(state, self.materials, self.scenes, request.get("state") or {}).encode()
        self.send(packed(payload, type="file", name="explorer.html", mime="text/html"))


# --- The thread -------------------------------------------------------------------------------------------------------


class Engine(threading.Thread):
    """Serves all sessions in turn, a step of each."""

    def __init__(self, variant: str, user: stages.UserScene, watched: Sequence[Path] = ()) -> None:
        super().__init__(name="mi_brdfs explorer", daemon=True)
        self.variant = variant
        self._watched = {path: _stamp(path) for path in watched}
        self._looked = time.monotonic()
        self.stages = stages.Stages(user)
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
            if self._watched and time.monotonic() - self._looked > LOOK:
                self._read_again()
                self._looked = time.monotonic()
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

    def _read_again(self) -> None:
        """Import files again that have been saved; what is wrong with one is told, and its former models stay."""
        for path, before in self._watched.items():
            now = _stamp(path)
            if now in (before, None):  # an editor may be about to put it in its place
                continue
            self._watched[path] = now
            try:
                import_models(str(path))
            except (ImportError, ValueError) as error:
                told = text(type="error", text=f"{path}: {error}")
            else:
                told = text(type="reloaded")
                self.stages.forget()
                for session in self.sessions:
                    session.forget()
            for session in self.sessions:
                session.send(told)


def _stamp(path: Path) -> Any:
    """Return what changes when a file is saved, or None if there is none."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino


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
