"""The command ``python docs/website``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

sys.path.insert(0, str(Path(__file__).parents[1]))

from generate.made import ROOT


def main(
    folder: Annotated[Path, typer.Argument(help="Where to: an empty folder, or a site to replace.")] = ROOT / "site",
) -> None:
    """Build the site: guide, gallery, reference, notebooks. A warning or a broken link is an error."""
    if folder.exists() and not (folder / "objects.inv").is_file() and (folder.is_file() or any(folder.iterdir())):
        print(f"{folder} is neither empty nor a site", file=sys.stderr)
        raise typer.Exit(2)
    try:
        from website.build import build
    except ImportError as error:
        # What another extra brings is told in a sentence, without a name.
        told = f"the site needs {error.name}: pip install 'mi_brdfs[site]'" if error.name else str(error)
        print(told, file=sys.stderr)
        raise typer.Exit(2) from None
    status = build(folder)
    print(folder / "index.html")
    raise typer.Exit(status)


if __name__ == "__main__":
    typer.run(main)
