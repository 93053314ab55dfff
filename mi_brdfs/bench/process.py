"""Function calls in new processes."""

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


def in_new_process(function: Callable, *arguments: Any) -> Any:
    """Return a function's result from a process that knows the same models (:func:`mi_brdfs.mitsuba.guests.source`),
    but no kernels of earlier runs: these are cached in the user's home folder, so the process gets an empty one.
    Arguments and result must be of JSON's types."""
    call = json.dumps([sys.path, guests.sources(), mi.variant(), function.__module__, function.__name__, arguments])
    with TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, "-c", f"from {__name__} import answer; answer()", call],
            capture_output=True, text=True, env=os.environ | {"HOME": folder, "TMP": folder},
        )  # fmt: skip
    if done.returncode:
        raise RuntimeError(f"{function.__name__} failed in its process:\n{done.stderr.strip()}")
    return json.loads(done.stdout.splitlines()[-1])


def answer() -> None:
    """Carry out the call given as the argument of the new process."""
    sys.path[:], sources, variant, module, name, arguments = json.loads(sys.argv[1])
    for source in sources:
        guests.import_models(source)
    mi.set_variant(variant)
    print(json.dumps(getattr(importlib.import_module(module), name)(*arguments)))
