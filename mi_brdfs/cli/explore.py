"""``mi-brdfs explore``"""

from __future__ import annotations

import _thread
import math
import os
import signal
import sys
import threading
import webbrowser
from pathlib import Path
from typing import Annotated, Any

import typer

from ..parameters.messages import brief, no_file
from .app import command, imported
from .options import (
    PAGES,
    Labels,
    Parameters,
    TracingVariant,
    file_option,
    material_argument,
    parameters_of,
    set_tracing_variant,
    source_of,
    write_text,
)
from .terminal import Exit, err, fail, failing, out, progress, stdout_to_stderr


@command(
    "Look",
    "explore walter burley:roughness=.3",
    "explore paint.binary fit.json:walter --scene room.xml:wall",
    "explore ward --export page.html --vary alpha=.05,.1,.2,.4",
)
def explore(
    targets: Annotated[list[str] | None, material_argument("Up to six.")] = None,
    parameters: Parameters = None,
    scene: Annotated[
        str | None,
        typer.Option(metavar="FILE.xml[:ID]", help="Show the pictures in this scene, in place of a BSDF or a shape's."),
    ] = None,
    environment: Annotated[
        Path | None, typer.Option(metavar="FILE.exr", help="An environment map to light the pictures with.")
    ] = None,
    mesh: Annotated[
        Path | None, typer.Option(metavar="FILE.ply|obj", help="Show the pictures on this mesh, whose y axis is up.")
    ] = None,
    labels: Labels = None,
    exposure: Annotated[float, typer.Option(min=-10, max=10, help="Brighten the pictures, in stops.")] = 0,
    export: Annotated[
        Path | None, file_option("--export", "Write a page that needs no server, and end.", "FILE.html", PAGES)
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE,…",
            help="With --export: a parameter to scrub through; twice at most, and theta, which is always there.",
        ),
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
    file, _, material = (scene or "").partition(".xml:")
    room = Path(f"{file}.xml" if material else file) if scene else None
    for option, path in (("scene", room), ("environment", environment), ("mesh", mesh)):
        if path and not path.is_file():
            fail(f"--{option} {no_file(path)}", Exit.USAGE)
    if vary and not export:
        fail("--vary is for pages of --export; in the live page move the sliders", Exit.USAGE)
    varied = _varied(vary or [])
    chosen = set_tracing_variant(variant, "_rgb")

    from ..explorer.server import listening, serve
    from ..explorer.stages import MESHES, UserScene
    from ..measured import read
    from ..measured.report.counts import in_one_plane
    from ..probe.sources import is_measured

    user = UserScene(room, material or None)
    sources, subjects = _subjects(targets or ["walter"], given)
    if labels:
        if (names := labels.count(",") + 1) != len(subjects):
            fail(f"--labels {labels}: give a name to each of the {len(subjects)} BSDFs, not {names}", Exit.USAGE)
        subjects = [each | {"name": name} for each, name in zip(subjects, labels.split(","), strict=True)]
    state: dict[str, Any] = {"subjects": subjects, "shape": "scene" if scene else "body", "exposure": exposure}
    files = [it.word for it in sources if is_measured(it.word)]
    if files:
        state["scale"] = "log"  # as where the page adds one
    if any(in_one_plane(read(it).data) for it in files):
        state["views"] = ["picture", "polar", "cartesian", "albedo"]  # a lobe would be mostly guessed
    if mesh and mesh.suffix.lower() not in MESHES:
        fail(f"--mesh {mesh}: give a file whose name ends in {' or '.join(MESHES)}", Exit.USAGE)
    state |= dict(user.add(it, brief(it.name)) for it in (environment, mesh) if it)
    if export:
        _export(export, user, sources, state, varied)
        return
    if not host:
        fail("--host: name an address of this machine, or 0.0.0.0 for all of them", Exit.USAGE)
    with failing(Exit.USAGE, ValueError):
        on = listening(host, port)

    def ready(address: str) -> None:
        out.print(address)
        if notebook:
            threading.Thread(target=_end_with_input, daemon=True).start()
        err.print("Ctrl-C ends the explorer.")
        if browser:
            with stdout_to_stderr():
                webbrowser.open(address)

    try:
        watched = [Path(it) for it in imported if it.endswith(".py")]
        with failing(Exit.USAGE):
            serve(on, host, chosen, user, watched, sources, state, ready, notebook)
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
    from ..mitsuba.registry import DATA, presets
    from ..probe.sources import is_measured, shared, split, value_of

    if len(targets) > SUBJECTS:
        fail(f"a page shows {SUBJECTS} BSDFs at most, these are {len(targets)}", Exit.USAGE)
    sources, subjects = [], []
    with failing(Exit.USAGE):
        for target, options in zip(targets, shared(targets, given), strict=True):
            word, own = split(target)
            texts = options | own
            if word in DATA:
                word = texts.pop("filename", word)
            values = plain({name: value_of(text) for name, text in texts.items()})
            if word in presets():
                subject = {"type": PRESET, "name": word, **values}
            elif is_measured(word):
                sources.append(source_of(word, {}))
                subject = {"type": MEASURED, "file": sources[-1].word, **values}
            elif not (word.startswith("<") or ".xml" in word or ".json" in word):
                subject = {"type": word, **values}
            elif isinstance(fitted := (source := source_of(word, texts)).load(), dict):
                subject = plain(fitted)
            else:
                sources.append(source._replace(word=target))
                subject = {"type": GIVEN, "file": target}
            materials = Materials({it.word: it for it in sources})
            with materials.loaded(materials.expanded(checked(subject))):
                pass
            subjects.append({"bsdf": subject, "name": Path(target).name if os.path.exists(target) else target})
    return sources, subjects


def _varied(texts: list[str]) -> dict[str, tuple[float, ...]]:
    """Return the values of --vary by name."""
    from ..explorer.state import LIMITS

    found = {}
    for text in texts:
        name, _, values = text.partition("=")
        try:
            found[name] = tuple(sorted({float(it) for it in values.split(",")}))
        except ValueError:
            fail(f"--vary {text}: give a name and numbers, such as alpha=0.05,0.1,0.2", Exit.USAGE)
        low, high = LIMITS["theta"] if name == "theta" else (-math.inf, math.inf)
        if not all(low <= it <= high and math.isfinite(it) for it in found[name]):
            limits = f" from {low} to {high} degrees" if name == "theta" else ""
            fail(f"--vary {text}: give finite numbers{limits}", Exit.USAGE)
    if len(found.keys() - {"theta"}) > 2:
        fail("--vary takes two parameters at most, besides theta", Exit.USAGE)
    return found


def _export(
    file: Path, user: Any, sources: list[Any], data: dict[str, Any], varied: dict[str, tuple[float, ...]]
) -> None:
    from ..explorer.export import page
    from ..explorer.materials import Materials
    from ..explorer.stages import Stages
    from ..explorer.state import parse

    with stdout_to_stderr(), failing(Exit.ERROR):
        scenes = Stages(user)
        state = parse(data, scenes.names, scenes.shapes)
        with progress("Drawing") as bar:
            combinations = math.prod(len(values) for name, values in varied.items() if name != "theta")
            task = bar.add_task("", total=len(state.subjects) * combinations)
            materials = Materials({it.word: it for it in sources})
            text = page(state, materials, scenes, data, varied, lambda: bar.advance(task))
    write_text(file, text)
    out.print(str(file))
