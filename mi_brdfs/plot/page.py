"""A Plotly figure as a small page: the library is in a file beside it, which several pages share."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import Any

from ..writing import write_text

# Bodies go below each other where the window is too narrow for them, and turn together.
SCRIPT = """
const plot = document.getElementById('{plot_id}');
const scenes = plot.layout.annotations.map((_, k) => k ? 'scene' + (k + 1) : 'scene');
function arrange() {
  const width = document.documentElement.clientWidth;
  const columns = Math.max(1, Math.min(scenes.length, 3, Math.floor(width / 300)));
  const rows = Math.ceil(scenes.length / columns);
  const side = Math.min(0.8 * width / columns, Math.max(300, window.innerHeight - 160));
  const {t, b} = plot.layout.margin;
  const layout = {width: width, height: rows * side + t + b};
  scenes.forEach((scene, k) => {
    const column = k % columns, row = Math.floor(k / columns);
    layout[scene + '.domain'] = {x: [column / columns, (column + 1) / columns],
                                 y: [1 - (row + 1) / rows, 1 - row / rows]};
    layout['annotations[' + k + '].x'] = (column + 0.5) / columns;
    layout['annotations[' + k + '].y'] = 1 - row / rows;
  });
  return Plotly.relayout(plot, layout);
}
let following = false;
plot.on('plotly_relayout', change => {
  const turned = Object.keys(change).find(name => name.endsWith('.camera'));
  if (!turned || following) return;
  const layout = {};
  scenes.forEach(scene => { if (scene + '.camera' !== turned) layout[scene + '.camera'] = change[turned]; });
  following = true;
  Plotly.relayout(plot, layout).then(() => { following = false; });
});
window.addEventListener('resize', arrange);
arrange();
"""


def write(figure: Any, path: Path) -> None:
    """Write a figure of :func:`~mi_brdfs.plot.sphere` as a page that needs no network, only the file beside it,
    ``plotly-VERSION.min.js``, which is written if it is not there."""
    from plotly import __version__
    from plotly.offline import get_plotlyjs

    library = path.with_name(f"plotly-{__version__}.min.js")
    if not library.exists():
        write_text(library, get_plotlyjs())
    body = figure.to_html(full_html=False, include_plotlyjs=False, post_script=SCRIPT, default_height="100vh",
                          config={"displayModeBar": False})  # fmt: skip
    title = ", ".join(dict.fromkeys(trace.name for trace in figure.data if trace.type == "surface"))
    write_text(
        path,
        f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(title)}</title>
<script src="{library.name}"></script>
<style>html {{ overflow: hidden scroll }} body {{ margin: 0 }}</style>
</head>
<body>
{body}
</body>
</html>
""",
    )
