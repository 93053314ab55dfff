"""``mi-brdfs explore``"""

from __future__ import annotations

import _thread
import os
import signal
import sys
import threading
import webbrowser
from pathlib import Path
from typing import Annotated, Any

import typer

from ..mitsuba.errors import one_line, unwrapped_ctrl_c
from .app import command
from .options import Parameters, check_output, parameters_of, write_text
from .terminal import Exit, err, fail, out, stdout_to_stderr
from .variants import TracingVariant, set_tracing_variant


@command()
def explore(
    targets: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="TYPE|FILE|PRESET…",
            help="Up to four: plugins of the pack or Mitsuba's, measured files, published materials, FILE.xml:ID.",
        ),
    ] = None,
    parameters: Parameters = None,
    scene: Annotated[
        str | None, typer.Option(metavar="FILE.xml[:ID]", help="Show the pictures in this scene, in place of its BSDF.")
    ] = None,
    environment: Annotated[
        Path | None, typer.Option(metavar="FILE.exr", help="An environment map to light the pictures with.")
    ] = None,
    export: Annotated[
        Path | None, typer.Option(metavar="FILE.html", help="Write a page that needs no server, and end.")
    ] = None,
    host: Annotated[str, typer.Option(help="Who may connect: by default only this machine.")] = "127.0.0.1",
    port: Annotated[int | None, typer.Option(min=0, max=65535, help="Default: 8490, or any free one.")] = None,
    browser: Annotated[bool, typer.Option(help="Open the page in the browser.")] = True,
    notebook: Annotated[bool, typer.Option("--notebook", hidden=True)] = False,
    variant: TracingVariant = None,
) -> None:
    """Open a page with sliders, lobes and pictures of BSDFs; Ctrl-C ends it."""
    try:
        import aiohttp  # noqa: F401
    except ImportError:
        fail('this needs the extra of this name: pip install "mi_brdfs[explore]"')
    given = parameters_of(parameters)
    check_output("--export", export)
    if environment and not environment.is_file():
        fail(f"--environment {environment}: no such file", Exit.USAGE)
    chosen = set_tracing_variant(variant)
    if not chosen.endswith("_rgb"):
        fail(f"this needs an rgb variant, not {chosen}", Exit.USAGE if variant else Exit.ERROR)

    from ..explorer.server import PortError, listening, serve
    from ..explorer.stages import UserScene

    file, _, material = (scene or "").partition(".xml:")
    user = UserScene(Path(f"{file}.xml" if material else file) if scene else None, material or None, environment)
    if user.scene and not user.scene.is_file():
        fail(f"--scene {user.scene}: no such file", Exit.USAGE)
    sources, subjects = _subjects(targets or ["walter"], given)
    state: dict[str, Any] = {"subjects": subjects, "stage": "environment" if environment else "studio"}
    state["shape"] = "scene" if scene else "body"
    if export:
        _export(export, user, sources, state)
        return
    try:
        on = listening(host, port)
    except PortError as error:
        fail(f"--port: {error}", Exit.USAGE)

    def ready(address: str) -> None:
        out.print(address)
        if notebook:
            threading.Thread(target=_end_with_input, daemon=True).start()
        err.print("Ctrl-C ends the explorer.")
        if browser:
            with stdout_to_stderr():
                webbrowser.open(address)

    try:
        with unwrapped_ctrl_c():
            serve(on, host, chosen, user, sources, state, ready, notebook)
        return
    except KeyboardInterrupt:
        err.print("Ended.")
    raise typer.Exit(Exit.INTERRUPTED)


def _end_with_input() -> None:
    """End this process with the one that started it."""
    sys.stdin.read()
    _thread.interrupt_main(signal.SIGTERM)


def _subjects(targets: list[str], given: dict[str, str]) -> tuple[list[Any], list[dict[str, Any]]]:
    """Return the files among the targets, and the subjects of the page."""
    from ..explorer.materials import Materials, plain
    from ..explorer.state import GIVEN, MEASURED, PRESET, SUBJECTS, checked
    from ..mitsuba.registry import presets
    from ..probe.sources import find_sources, is_measured, value_of

    if len(targets) > SUBJECTS:
        fail(f"a page shows {SUBJECTS} BSDFs at most, these are {len(targets)}", Exit.USAGE)
    values = plain({name: value_of(text) for name, text in given.items()})
    sources, subjects = [], []
    known = set(presets())
    for target in targets:
        try:
            with unwrapped_ctrl_c():
                if target in known:
                    subject = {**Materials().expanded({"type": PRESET, "name": target}), **values}
                elif ".xml" in target or target.startswith("<") or (is_measured(target) and os.path.exists(target)):
                    found = list(find_sources(target, given if not is_measured(target) else {}))
                    if len(found) > 1:
                        words = ", ".join(it.word for it in found)
                        raise ValueError(f"{target} has several materials; name one of {words}")
                    sources += found
                    kind = MEASURED if is_measured(target) else GIVEN
                    subject = {"type": kind, "file": found[0].word, **(values if kind == MEASURED else {})}
                else:
                    subject = {"type": target, **values}
                materials = Materials({it.word: it for it in sources})
                with materials.loaded(materials.expanded(checked(subject))):
                    pass
                subjects.append({"bsdf": subject, "name": Path(target).name if os.path.exists(target) else target})
        except (ValueError, RuntimeError) as error:
            fail(one_line(error), Exit.USAGE)
    return sources, subjects


def _export(file: Path, user: Any, sources: list[Any], data: dict[str, Any]) -> None:
    from ..explorer.export import page
    from ..explorer.materials import Materials
    from ..explorer.stages import Stages
    from ..explorer.state import parse

    try:
        with stdout_to_stderr(), unwrapped_ctrl_c():
            scenes = Stages(user)
            state = parse(data, scenes.names)
            text = page(state, Materials({it.word: it for it in sources}), scenes, data)
    except (ValueError, RuntimeError) as error:
        fail(one_line(error))
    write_text(file, text)
    out.print(str(file))
