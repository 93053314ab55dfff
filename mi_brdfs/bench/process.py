"""Functions in processes of their own."""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
from collections.abc import Callable
from tempfile import TemporaryDirectory
from typing import Any

import mitsuba as mi

from ..mitsuba import guests


def in_new_process(function: Callable, *arguments) -> Any:
    """What a function returns in a process that knows the same models (:func:`mi_brdfs.mitsuba.guests.source`), but no
    kernels of earlier runs: these lie in the user's folder, so it gets an empty one. Arguments and result are of the
    types that JSON has."""
    call = json.dumps([sys.path, guests.sources(), mi.variant(), function.__module__, function.__name__, arguments])
    with TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, "-c", f"from {__name__} import answer; answer()", call],
            capture_output=True, text=True, env=os.environ | {"HOME": folder, "TMP": folder},
        )  # fmt: skip
    if done.returncode:
        raise RuntimeError(f"{function.__name__} failed in a process of its own:\n{done.stderr.strip()}")
    return json.loads(done.stdout.splitlines()[-1])


def answer():
    """What the new process does: the call that is its argument."""
    sys.path[:], sources, variant, module, name, arguments = json.loads(sys.argv[1])
    for source in sources:
        guests.import_models(source)
    mi.set_variant(variant)
    print(json.dumps(getattr(importlib.import_module(module), name)(*arguments)))
