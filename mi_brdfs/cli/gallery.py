"""``mi-brdfs gallery``"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from ..rendering import MOST_PIXELS
from .app import command
from .files import check_output
from .options import FIGURES, PAGES, AnyVariant, Types, set_variant
from .terminal import Exit, err, fail, failing, out, progress, stdout_to_stderr


@command("Look", "gallery ward walter --presets -o pictures")
def gallery(
    types: Types = None,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FOLDER", help="Created if it does not exist.")
    ] = Path("gallery"),
    spp: Annotated[
        int, typer.Option(min=1, help="Samples per pixel, rounded up to a power of 4; the pictures are denoised.")
    ] = 16,
    size: Annotated[
        int, typer.Option(min=16, max=MOST_PIXELS, help="Width and height of each picture, in pixels.")
    ] = 256,
    presets: Annotated[
        bool, typer.Option("--presets", help="Also render each model's published materials: TYPE_presets.jpg.")
    ] = False,
    variant: AnyVariant = None,
) -> None:
    """Render models with sweeps of their parameters: contact sheets, and a page that shows them, in about half a minute
    a model. Ctrl-C keeps the finished pictures."""
    from ..gallery import gallery as render_gallery

    if output.suffix.lower() in (*FIGURES, *PAGES):
        fail(f"-o {output}: name a folder, in which there will be a page and its pictures", Exit.USAGE)
    if (page := output / "index.html").exists():
        check_output("-o", page, mark="<title>What BRDFs look like</title>")
    elif any(it.suffix in (".png", ".jpg") for it in output.glob("*")):
        fail(f"-o {output}: it has other pictures; name a folder of the gallery's own", Exit.USAGE)
    chosen = set_variant(variant)
    start, finished, total = time.perf_counter(), 0, 0
    with stdout_to_stderr(), progress("Rendering") as bar:
        task = bar.add_task("", total=None)

        def advance(type: str, done: int, of: int) -> None:
            nonlocal finished, total
            before = bar.tasks[task].description
            if before not in ("", type) and not err.is_terminal:  # there is no bar
                err.print(f"{before} is finished; {finished} of {of} pictures.")
            finished, total = done, of
            bar.update(task, description=type, completed=done, total=of)

        try:
            with failing(Exit.USAGE, ValueError), failing(Exit.ERROR, RuntimeError):
                render_gallery(types or (), output, spp, size, advance, presets)
        except OSError as error:
            fail(f"cannot write to the folder {output}: {error.strerror}")
        except KeyboardInterrupt:
            pass
    if finished:
        out.print(str(page))
    if not finished or finished < total:
        kept = f"it has {finished} of {total} pictures" if finished else "nothing is finished, nothing was written"
        err.print(f"Interrupted; {kept}.")
        raise typer.Exit(Exit.INTERRUPTED)
    err.print(f"{total} pictures in {time.perf_counter() - start:.0f} s, {chosen}.")
