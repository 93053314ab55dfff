"""The command ``python docs/generate``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

sys.path.insert(0, str(Path(__file__).parents[1]))

from generate import balls, bench, front, models, notebooks, polarization, scenes, shading
from generate.made import ROOT, Page, Picture

import mitsuba as mi  # after mi_brdfs, which chooses the LLVM that it loads  # isort: skip


def everything() -> list[Page | Picture]:
    """Return all generated files, each after its sources."""
    pages = [*scenes.pages(), *models.pages(), *bench.pages()]
    drawn = [
        *models.pictures(),
        *scenes.pictures(),
        *shading.pictures(),
        *polarization.pictures(),
        *front.pictures(),
        *balls.pictures(),
    ]
    return [*pages, *drawn, *notebooks.pictures()]


def main(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="NAME…", help="Models and scenes to make even if current.")
    ] = None,
    every: Annotated[bool, typer.Option("--all", help="Make everything, stale or not.")] = False,
    check: Annotated[bool, typer.Option("--check", help="List what is stale; exit with 1 if anything is.")] = False,
) -> None:
    """Make stale pages and pictures: the models' reference, the table in README.md, the results of the bench, the
    scenes' page and the scene with all models; thumbnails, sweeps, pictures of scenes, those of README.md,
    the explorer's balls of published materials, and the outputs of notebooks."""
    mi.set_variant("llvm_ad_rgb")
    made, wanted = everything(), set(names or ())
    if unknown := wanted - {each.path.stem for each in made}:
        raise typer.BadParameter(f"nothing is called {min(unknown)}")
    stale = False
    for each in made:
        if each.is_stale() or (not check and (every or each.path.stem in wanted)):
            stale = True
            print(each.path.relative_to(ROOT).as_posix(), flush=True)
            if not check:
                each.make()
    if check and stale:
        raise typer.Exit(1)


if __name__ == "__main__":
    typer.run(main)
