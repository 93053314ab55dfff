"""The files of the page; and a page that needs no server, which has them and the frames of its views in it."""

from __future__ import annotations

import base64
import json
import re
from dataclasses import replace
from importlib.resources import files
from typing import Any

from . import stages
from .materials import Materials
from .state import State, declared
from .views import VIEWS, ComponentProbe, Frame, frames, packed, text

SPP = 64
"""Samples per pixel of its pictures."""
SIZE = 320
"""… and the most pixels of a side."""
CLIENT = files(__package__) / "client"


def client_file(name: str) -> str:
    """Return a file of the page."""
    return (CLIENT / name).read_text(encoding="utf-8")


def index() -> str:
    """Return the page, with what :mod:`~mi_brdfs.explorer.state` declares."""
    data = json.dumps(declared())
    return client_file("index.html").replace('id="declared">', f'id="declared">{data}')


def page(state: State, materials: Materials, scenes: stages.Stages, page_state: dict[str, Any]) -> str:
    """Return the page with all views of a state; ``page_state`` is what the page itself said of it.

    Raises:
        StateError: if a subject cannot be shown.
    """
    state = replace(state, size=min(state.size, SIZE))
    sent = [{"text": frame} if isinstance(frame, str) else _split(frame) for frame in _frames(state, materials, scenes)]
    data = json.dumps({"state": page_state, "frames": sent}).replace("<", "\\u003c")
    return _inlined(f'<script type="application/json" id="exported">{data}</script>')


def _frames(state: State, materials: Materials, scenes: stages.Stages) -> list[Frame]:
    found: list[Frame] = []
    for k, given in enumerate(state.subjects):
        bsdf = materials.expanded(given)
        told = {"controls": materials.controls(bsdf), **materials.written(bsdf), **materials.described(bsdf)}
        found.append(text(type="subject", serial=0, subject=k, bsdf=None, error=None, **told))
        with materials.loaded(bsdf) as loaded:
            probe = ComponentProbe(loaded, state.component)
            for view in VIEWS:
                found += frames(view, probe, state, 0, k)
        progress = stages.Progress(scenes.stage(stages.Setting.of(state)))
        while progress.spp < SPP:
            with materials.loaded(bsdf) as loaded:
                progress.advance(loaded)
        payload, header = stages.shown(progress, state.exposure, scenes.denoise)
        found.append(packed(payload, type="picture", serial=0, subject=k, final=True, **header))
    return found


def _split(frame: bytes) -> dict[str, Any]:
    """Return the header of a binary frame, and its payload as text."""
    end = 4 + int.from_bytes(frame[:4], "little")
    return {"header": json.loads(frame[4:end]), "payload": base64.b64encode(frame[end:]).decode()}


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
