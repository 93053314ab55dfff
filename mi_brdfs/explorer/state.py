"""What a page sends: its state, which is what it shows, and requests. It comes from a browser, as data, and is checked
before anything is done. The members of a state are declared here, and the page takes them from :func:`declared`."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from ..parameters.messages import brief, listed

SUBJECTS = 6
"""The most materials of a page; the protocol calls them subjects."""
PARAMETERS = 64
"""The most parameters of a subject."""
LIMITS = {"theta": (0, 89), "phi": (-180, 180), "exposure": (-10, 10), "component": (0, 99), "size": (64, 1024),
          "wipe": (0, 1), "turn": (-180, 180), "yaw": (-180, 180), "pitch": (-15, 70)}  # fmt: skip
"""The least and the largest value of members: of ``size`` in pixels, of ``exposure`` in stops, of angles in degrees."""
VIEWS = "picture", "lobe", "polar", "cartesian", "albedo", "slice", "hemisphere", "sampler"
WORDS = {
    "channel": ("luminance", "rgb", "red", "green", "blue"),
    "axis": ("theta_o", "theta_h", "theta_d", "phi"),
    "compare": ("side", "wipe", "difference"),
    "scale": ("linear", "log"),
    "lobes": ("over", "side"),
}
OF_THE_PAGE: dict[str, Any] = {
    "compare": "side", "pair": (0, 1), "wipe": 0.5, "scale": "linear", "normalise": False, "dark": None, "tour": None,
    "lobes": "over", "wire": False,
}  # fmt: skip
"""The members that only the page needs, how it shows what it has: it does not send them."""
SHAPES = "body", "sphere", "scene"
INCIDENCE = "incidence"
"""The light that comes from ωi."""
UPLOAD = "upload-"
"""How the names of uploaded files begin."""
EVERY = "all"
"""In place of a model's name, all of them."""
MEASURED, GIVEN, PRESET = "tabulated", "given", "preset"
"""The types of subjects that are files, materials of the command line, and published materials."""
REQUESTS, SAVED = ("chi2", "fit", "cancel", "save"), ("exr", "page", "scene")
LONGEST = 1 << 16
"""The most letters of a message."""
LARGEST = 3.4e38
"""The largest number of float32, about."""
NAME, WORD = re.compile(r"[A-Za-z]\w{0,63}(\.\w{1,64}){0,3}"), re.compile(r"[\w .+/-]{0,100}")

Bsdf = dict[str, Any]
"""A plugin dict of plain values: numbers, words, true or false, and colours as [r, g, b]."""


class StateError(ValueError):
    """A state that cannot be shown, with what is wrong with it in a sentence."""


@dataclass(frozen=True)
class State:
    """What a page shows; its members are those of the protocol."""

    subjects: tuple[Bsdf, ...]
    hidden: tuple[bool, ...]
    theta: float = 45.0
    phi: float = 0.0
    channel: str = "luminance"
    component: int | None = None
    cosine: bool = True
    """Whether lobes, curves and hemispheres show f |cosθo|, and not f."""
    axis: str = "theta_o"
    """What the cartesian plot goes along: θo in the plane of incidence, θh or θd at φd = 90°, or φo - φi at θo = θi."""
    stage: str = "studio"
    shape: str = "body"
    exposure: float = 0.0
    turn: float = 0.0
    """By how much the environment is turned about the vertical."""
    yaw: float = 0.0
    pitch: float = 0.0
    """By how much the camera has gone around what it looks at, and up."""
    size: int = 256
    views: tuple[str, ...] = ("picture", "lobe", "polar", "albedo")
    dragged: bool = False
    """Whether a hand moves something at this moment: lobes and their cuts are coarse."""

    @property
    def channels(self) -> list[tuple[str, int | None]]:
        """The channels of curves, by name and number; None is the luminance."""
        colours = [("red", 0), ("green", 1), ("blue", 2)]
        if self.channel == "rgb":
            return list(colours)
        return [(self.channel, dict(colours).get(self.channel))]


def declared() -> dict[str, Any]:
    """Return what the page has to know of the members of a state."""
    defaults = {it.name: it.default for it in fields(State) if it.name not in ("subjects", "hidden")}
    return {
        "subjects": SUBJECTS, "views": VIEWS, "limits": LIMITS, "words": WORDS, "own": list(OF_THE_PAGE),
        "defaults": {"subjects": [], **defaults, **OF_THE_PAGE},
    }  # fmt: skip


def decoded(data: str | bytes) -> dict[str, Any]:
    """Return a message: an object with a type. Raise a StateError if it is none."""
    if len(data) > LONGEST:
        raise StateError(f"A message has {LONGEST} letters at most.")
    try:
        found = json.loads(data)
    except (ValueError, RecursionError):
        found = None
    is_message = isinstance(data, str) and isinstance(found, dict) and isinstance(found.get("type"), str)
    if not is_message or not _is_number(found.get("serial", 0)):
        raise StateError("This is no message of the explorer.")
    return found


def checked_request(message: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a message that asks for something, or raise a StateError."""
    kind, subject = message["type"], message.get("subject", 0)
    if kind not in REQUESTS:
        raise StateError(f"There is no message {brief(kind)!r}.")
    if type(subject) is not int or not 0 <= subject < SUBJECTS:
        raise StateError(f"subject is a number from 0 to {SUBJECTS - 1}.")
    if kind == "fit" and not (isinstance(message.get("model"), str) and isinstance(message.get("metric"), str)):
        raise StateError("A fit needs a model and a metric, which are words.")
    if kind == "save" and message.get("what") not in SAVED:
        raise StateError(f"What can be saved is {listed(SAVED)}.")
    page = message.get("state", {})
    if kind == "save" and not (isinstance(page, Mapping) and _are_objects(page.get("subjects", []))):
        raise StateError("The state of a page is an object, with one for each material.")
    return message


def parse(data: Any, stages: Sequence[str], shapes: Sequence[str] = SHAPES) -> State:
    """Return the state that a page sent, with the defaults for what it does not say, or raise a StateError."""
    if not isinstance(data, Mapping):
        raise StateError("The state of a page is an object.")
    subjects = data.get("subjects")
    if not isinstance(subjects, list) or not 1 <= len(subjects) <= SUBJECTS:
        raise StateError(f"A page has one to {SUBJECTS} materials.")
    if not _are_objects(subjects):
        raise StateError("A material is an object with a bsdf.")
    views = data.get("views", State.views)
    if not isinstance(views, (list, tuple)) or any(it not in VIEWS for it in views):
        raise StateError(f"views are {listed(VIEWS)}.")
    known = {"channel": WORDS["channel"], "axis": WORDS["axis"], "stage": stages, "shape": shapes}
    words: dict[str, Any] = {name: _word(data, name, of_it) for name, of_it in known.items()}
    numbers: dict[str, Any] = {it: _number(data, it) for it in ("theta", "phi", "exposure", "turn", "yaw", "pitch")}
    return State(
        subjects=tuple(checked(it.get("bsdf")) for it in subjects),
        hidden=tuple(bool(it.get("hidden")) for it in subjects),
        **words,
        **numbers,
        component=None if data.get("component") is None else int(_number(data, "component")),
        cosine=data.get("cosine") is not False,
        size=int(_number(data, "size")),
        views=tuple(view for view in VIEWS if view in views),
        dragged=data.get("dragged") is True,
    )


def checked(bsdf: Any) -> Bsdf:
    """Return a plugin dict of plain values. Raise a StateError if it is none, or names a file other than by its key."""
    if not isinstance(bsdf, Mapping) or not isinstance(bsdf.get("type"), str):
        raise StateError("A material needs a bsdf with a type.")
    if len(bsdf) > PARAMETERS:
        raise StateError(f"A bsdf has at most {PARAMETERS} parameters.")
    for name, value in bsdf.items():
        if not isinstance(name, str) or not NAME.fullmatch(name) or name == "filename":
            raise StateError(f"{brief(str(name))} cannot be a parameter here.")
        is_file = name == "file" and bsdf["type"] in (MEASURED, GIVEN) and isinstance(value, str)
        if not is_file and not _is_plain(value):
            raise StateError(f"{name} must be a number, a word, true, false or a colour [r, g, b].")
    return dict(bsdf)


def key_of(value: Any) -> str:
    """Return a text that is the same for equal values."""
    return json.dumps(value, sort_keys=True)


def _are_objects(values: Any) -> bool:
    return isinstance(values, list) and all(isinstance(it, Mapping) for it in values)


def _is_plain(value: Any) -> bool:
    if isinstance(value, list):
        return len(value) == 3 and all(_is_number(it) for it in value)
    return isinstance(value, bool) or _is_number(value) or (isinstance(value, str) and bool(WORD.fullmatch(value)))


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= LARGEST


def _number(data: Mapping[str, Any], name: str) -> float:
    value = data.get(name, getattr(State, name))
    if not _is_number(value):
        raise StateError(f"{name} is a number.")
    low, high = LIMITS[name]
    return min(max(float(value), low), high)


def _word(data: Mapping[str, Any], name: str, words: Sequence[str]) -> str:
    value = data.get(name, getattr(State, name))
    if not isinstance(value, str) or value not in words:
        told = f"{name} = {brief(value)!r}" if isinstance(value, str) else name
        raise StateError(f"{told} is unknown; it is {listed(words)}.")
    return value
