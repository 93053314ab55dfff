"""``mi-brdfs upgrade``"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from ..parameters.messages import no_file
from .app import command
from .options import Lenient, file_option, parameters_of, parameters_option, write_text
from .terminal import Exit, err, fail, failing, out


@command("Look", "upgrade old.xml -o new.xml")
def upgrade(
    old: Annotated[Path, typer.Argument(metavar="OLD.xml", help="A scene of Mitsuba 0.2 to 0.6.")],
    output: Annotated[
        Path | None,
        file_option("-o", "The scene of Mitsuba 3 to write. Default: the standard output.", "NEW.xml", [".xml"]),
    ] = None,
    lenient: Lenient = False,
    define: Annotated[list[str] | None, parameters_option("Set a <default> parameter of the scene.")] = None,
) -> None:
    """Write an old scene as one of Mitsuba 3, and say what changed, line by line."""
    from ..legacy import is_new, upgrade  # imports numpy

    if not old.is_file():
        fail(no_file(old), Exit.USAGE)
    if is_new(old):
        if define:
            fail(f"-D {define[0]}: {old} is a scene of Mitsuba 3, which stays as it is", Exit.USAGE)
        if output and not os.path.samefile(output.absolute().parent, old.absolute().parent):
            fail(
                f"-o {output}: {old} is a scene of Mitsuba 3, which is copied as it is and would not find its files "
                "there; write it into its own folder",
                Exit.USAGE,
            )
    with failing(Exit.ERROR, ValueError, OSError):
        new = upgrade(old, lenient=lenient, folder=output and output.parent, **parameters_of(define))
    err.print("\n".join([*new.report().splitlines(), f"Mitsuba {new.version}: {new.summary()}"]))
    if output:
        write_text(output, new.xml)
    else:
        out.print(new.xml, end="")
