"""The files of the page; and a page that needs no server, which has them and the frames of its views in it."""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, product
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np

from ..parameters.messages import listed
from ..rendering.output import encoded
from . import stages
from .controls import LOBES, Control, with_value
from .materials import Materials
from .state import Bsdf, State, StateError, declared
from .views import VIEWS, Frame, frame, packed, text

SPP = 64
"""Samples per pixel of its pictures."""
SIZE = 320
"""… and the most pixels of a side."""
ANGLES = 0.0, 15.0, 30.0, 45.0, 60.0, 70.0, 80.0, 85.0
"""The angles of incidence that a page holds, besides its own, in degrees."""
LARGEST = 3e6
"""The most bytes of a page."""
Varied = Mapping[str, Sequence[float]]
"""The values of scrubbers, by the names of parameters; ``theta`` is the angle of incidence."""
At = tuple[int | None, ...]
CLIENT = Path(__file__).parent / "client"


def client_file(name: str) -> str:
    """Return a file of the page."""
    return (CLIENT / name).read_text(encoding="utf-8")


def index() -> str:
    """Return the page, with what :mod:`~mi_brdfs.explorer.state` declares."""
    data = json.dumps(declared())
    return client_file("index.html").replace('id="declared">', f'id="declared">{data}')


def page(
    state: State,
    materials: Materials,
    scenes: stages.Stages,
    page_state: dict[str, Any],
    vary: Varied | None = None,
    on_progress: Callable[[], None] = lambda: None,
) -> str:
    """Return the page with all views of a state, at several angles of incidence and values of parameters;
    ``page_state`` is what the page itself said of it. ``on_progress`` is called after the views of each subject at each
    combination of the values. Raise a StateError if a subject cannot be shown, none has such a parameter, or the page
    would be too large."""
    told = page_state.get("subjects") or [{} for _ in state.subjects]
    if len(told) != len(state.subjects):
        raise StateError("The state of a page is of other materials than those shown.")
    bsdfs = [materials.expanded(it) for it in state.subjects]
    controls = [materials.controls(it) for it in bsdfs]
    now: dict[str, Any] = {"theta": state.theta}
    for control in chain(*controls):
        if control["kind"] == "number":
            now.setdefault(control["name"], control["value"])
    vary = vary or {}
    if missing := [name for name in vary if name not in now]:
        raise StateError(f"{missing[0]} is no number of these BSDFs; choose {listed(now)}.")
    for control in chain(*controls):
        if control["name"] in vary and (rivals := vary.keys() & control["excludes"]):
            raise StateError(f"{control['name']} and {min(rivals)} exclude each other; vary one of them.")
    state = replace(state, size=min(state.size, SIZE), dragged=bool(vary))  # lobes of many values are coarse
    vary = {"theta": tuple(sorted({*ANGLES, state.theta})), **vary}
    views = set(VIEWS if len(vary) == 1 else state.views)
    # Along θo, the cartesian plot has its curves from the polar one.
    is_same = state.axis == "theta_o" and not views.isdisjoint({"polar", "cartesian"})
    views = views - {"cartesian"} | {"polar"} if is_same else views
    baked = _Baked(state, materials, scenes, vary, [name for name in VIEWS if name in views], on_progress)
    drawn = chain(*(baked.frames(k, *own) for k, own in enumerate(zip(bsdfs, controls, strict=True))))
    frames = [(at, it.encode() if isinstance(it, str) else it, isinstance(it, str)) for at, it in drawn]
    full = [bsdf | _values(own) for bsdf, own in zip(bsdfs, controls, strict=True)]
    starts = {name: _nearest(values, now[name]) for name, values in vary.items()}
    content = {
        "state": {**page_state, "subjects": [{**it, "bsdf": bsdf} for it, bsdf in zip(told, full, strict=True)]},
        "scrubbers": [{"name": name, "values": values, "start": starts[name]} for name, values in vary.items()],
        "views": ["picture", *baked.views, *(["cartesian"] if is_same else [])],
        "frames": [(at, len(it), is_text) for at, it, is_text in frames],
        "data": base64.b64encode(gzip.compress(b"".join(it for _, it, _ in frames), mtime=0)).decode(),
    }
    data = json.dumps(content).replace("<", "\\u003c")
    found = _inlined(f'<script type="application/json" id="exported">{data}</script>')
    if len(found) > LARGEST:
        raise StateError(f"The page would have {len(found) / 1e6:.1f} MB and may have {LARGEST / 1e6:.0f}: "
                         "export fewer materials, or fewer values of parameters.")  # fmt: skip
    return found


def _values(controls: list[Control]) -> Bsdf:
    return {it["name"]: it["value"] for it in controls if it["value"] is not None and it["name"] != LOBES}


def _nearest(values: Sequence[float], value: float | None) -> int:
    """Return where the value is that is nearest to another one, or the first where there is no other."""
    return min(range(len(values)), key=lambda at: 0 if value is None else abs(values[at] - value))


@dataclass
class _Baked:
    """Makes the frames of a page, each with the places of the scrubbers at which it is shown, None for any."""

    state: State
    materials: Materials
    scenes: stages.Stages
    vary: Varied
    views: list[str]
    """Besides the picture."""
    on_progress: Callable[[], None]

    def frames(self, k: int, bsdf: Bsdf, controls: list[Control]) -> Iterator[tuple[At, Frame]]:
        """Yield all frames of a subject."""
        nowhere: At = (None,) * len(self.vary)
        told = {"controls": controls, **self.materials.written(bsdf), **self.materials.described(bsdf)}
        yield nowhere, text(type="subject", serial=0, subject=k, bsdf=None, error=None, **told)
        numbers = {it["name"]: it for it in controls if it["kind"] == "number"}
        varied = [numbers.get(name) if name != "theta" else None for name in self.vary]
        ways = [enumerate(self.vary[it["name"]]) if it else [(None, 0.0)] for it in varied]
        for values in product(*ways):
            other = bsdf
            for control, (_, value) in zip(varied, values, strict=True):
                other = with_value(other, control, value) if control else other
            yield from self._views(k, other, tuple(at for at, _ in values))
            self.on_progress()

    def _views(self, k: int, bsdf: Bsdf, places: At) -> Iterator[tuple[At, Frame]]:
        def at(theta: int) -> At:
            return tuple(theta if name == "theta" else it for name, it in zip(self.vary, places, strict=True))

        with self.materials.loaded(bsdf) as loaded:
            for name in self.views:
                view = VIEWS[name]
                shown = [replace(self.state, theta=theta) for theta in self.vary["theta"]]
                is_same = len({view.depends(it) for it in shown}) == 1
                for theta, state in enumerate(shown[:1] if is_same else shown):
                    drawn = frame(name, loaded, self.materials.data(bsdf), state, 0, k)
                    yield places if is_same else at(theta), drawn if isinstance(drawn, str) else _rounded(drawn)
        progress = self.scenes.progress(stages.Setting.of(self.state))
        while progress.spp < SPP:
            with self.materials.loaded(bsdf) as loaded:
                progress.advance(loaded)
        if self.scenes.denoise:
            progress.denoise(self.scenes.denoise)
        pixels, header = stages.shown(progress, self.state.exposure)
        rgb = np.frombuffer(pixels, np.uint8).reshape(header["height"], header["width"], 4)[..., :3]
        payload = encoded(mi.Bitmap(np.ascontiguousarray(rgb)), "JPEG", 92)
        header |= {"type": "picture", "serial": 0, "subject": k, "final": True, "mime": "image/jpeg"}
        yield places, packed(payload, **header)


def _rounded(drawn: bytes) -> bytes:
    """Return a frame of float32 with 12 bits of their mantissas, which can be compressed."""
    end = 4 + int.from_bytes(drawn[:4], "little")
    bits = np.frombuffer(drawn[end:], np.uint32)
    return drawn[:end] + ((bits + np.uint32(0x400)) & np.uint32(0xFFFFF800)).tobytes()


def _inlined(data: str) -> str:
    """Return the page with its files in it, and the data in front of its scripts."""

    def read(path: str) -> str:
        return client_file(path.rpartition("/")[2])

    source = re.sub(r'<link rel="stylesheet" href="([^"]+)"[^>]*>', lambda it: f"<style>{read(it[1])}</style>", index())
    scripts = re.findall(r'<script type="module" src="([^"]+)"></script>', source)
    merged = "\n".join(_without_imports(read(name)) for name in scripts)
    source = re.sub(r'\s*<script type="module" src="[^"]+"></script>', "", source)
    return source.replace("</body>", f'{data}\n<script type="module">{merged}</script>\n</body>')


def _without_imports(script: str) -> str:
    """Return a module's text without its imports and exports: all modules become one."""
    script = re.sub(r"^import\b[^;]*;\n", "", script, flags=re.MULTILINE)
    return re.sub(r"^export (?=(const|let|function|class|async)\b)", "", script, flags=re.MULTILINE)
