"""The command ``python docs/website``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

sys.path.insert(0, str(Path(__file__).parents[1]))

from generate.made import ROOT


def main(
    folder: Annotated[Path, typer.Argument(help="Where to; made anew.")] = ROOT / "site",
) -> None:
    """Build the site: guide, gallery, reference, notebooks. A warning or a broken link is an error."""
    try:
        from website.build import build
    except ImportError as error:
        print(f"the site needs {error.name}: pip install 'mi_brdfs[site]'", file=sys.stderr)
        raise typer.Exit(2) from None
    raise typer.Exit(build(folder))


if __name__ == "__main__":
    typer.run(main)
