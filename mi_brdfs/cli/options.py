"""Options that several commands share."""

from __future__ import annotations

import json
from collections.abc import Collection
from pathlib import Path

from .terminal import Exit, fail


def check_names(names: list[str] | None, known: Collection[str], kind: str) -> None:
    for name in names or []:
        if name not in known:
            fail(f"--only {name}: there is no such {kind}; there are {', '.join(known)}", Exit.USAGE)


def check_folder(option: str, file: Path | None) -> None:
    if file is not None and not file.absolute().parent.is_dir():
        fail(f"{option} {file}: there is no folder {file.parent}", Exit.USAGE)


def write_json(file: Path | None, data: list | dict) -> None:
    if file is not None:
        file.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
