"""Write the summary of what `mi-brdfs bench --json docs/bench.json` measured into README.md.

python docs/bench_page.py
"""

from __future__ import annotations

import json
import re
from pathlib import Path

from mi_brdfs.bench import Results

ROOT = Path(__file__).parents[1]
MEASURED = ROOT / "docs" / "bench.json"
README = ROOT / "README.md"
PLACE = re.compile(r"(?<=<!-- bench -->\n).*?(?=<!-- end of bench -->)", re.DOTALL)


def readme() -> str:
    """The text of README.md, with its summary anew."""
    results = Results.from_dict(json.loads(MEASURED.read_text(encoding="utf-8")))
    text, places = PLACE.subn(lambda _: f"\n{results.markdown()}\n", README.read_text(encoding="utf-8"))
    if places != 1:
        raise ValueError("README.md has no place for it between <!-- bench --> and <!-- end of bench -->.")
    return text


def main():
    README.write_text(readme(), encoding="utf-8")


if __name__ == "__main__":
    main()
