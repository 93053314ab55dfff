"""Generate the small pictures of README.md: what the pack does, at a glance."""

from __future__ import annotations

import io
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import partial

import mi_brdfs
from mi_brdfs import plot
from mi_brdfs.explorer.materials import BALLS
from mi_brdfs.fit import fit
from mi_brdfs.fit.figures import lobes, probe_of
from mi_brdfs.lobes import LambertLobe
from mi_brdfs.measured import read
from mi_brdfs.models.lambert import Lambert
from mi_brdfs.pages.figures import DIFFERENCE
from mi_brdfs.plot.style import COLOURS, INK, SMALL, TEXT, incidence
from mi_brdfs.rendering.output import denoise, display_image
from mi_brdfs.validation import check
from mi_brdfs.validation.pictures import pictures as drawn

import mitsuba as mi  # after mi_brdfs, which chooses the LLVM that it loads  # isort: skip

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from PIL import Image

from .balls import BALL
from .made import ROOT, Picture, code, saved

FOLDER = ROOT / "docs" / "pictures"
SIZE = 640, 480
GLOBE = ROOT / "scenes" / "textured.xml"
SHOWN = "walter", "cooktorrance", "-Dmaterial=Al", "-Dalpha=0.2"
MEASURED = ROOT / "scenes" / "measured" / "aeroglaze_z307.bsdf"


def pictures() -> list[Picture]:
    made: dict[str, Callable[[], Image.Image]] = {
        "explorer.jpg": _explorer, "lobes.png": _lobes, "fits.png": _fits, "checker.png": _checker, "globe.jpg": _globe,
        "published.jpg": _published,
    }  # fmt: skip
    return [Picture(FOLDER / name, partial(_sources, name), saved(draw)) for name, draw in made.items()]


def _sources(name: str) -> list[str | bytes]:
    """Return what a picture is made from."""
    files = {"fits.png": [MEASURED], "globe.jpg": [GLOBE], "published.jpg": [BALLS]}.get(name, [])
    return [code(sys.modules[__name__]), *(file.read_bytes() for file in files if file.is_file())]


def _image(figure: Figure) -> Image.Image:
    """Return a figure, in the middle of a white picture of the common size."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=240, facecolor="white", bbox_inches="tight", pad_inches=0.05)
    image = Image.open(stream).convert("RGB")
    image.thumbnail(SIZE, Image.Resampling.LANCZOS)
    white = Image.new("RGB", SIZE, "white")
    white.paste(image, tuple((all_ - own) // 2 for all_, own in zip(SIZE, image.size, strict=True)))
    return white


def _lobes() -> Image.Image:
    """The lobe of Ward's model as it gets rougher."""
    wards = [{"type": "ward", "alpha": alpha} for alpha in (0.1, 0.2, 0.4)]
    return _image(plot.polar(*wards, angles=(40,), scale="log"))


def _fits() -> Image.Image:
    """Two models beside a measurement."""
    fits = fit(MEASURED, ["ward", "walter"], starts=2)
    figure = lobes(read(MEASURED), [probe_of(it) for it in fits], 88)[-1][1]
    interpolated, data, *lines, mirror = figure.axes[0].lines
    interpolated.remove()
    for k, (line, it) in enumerate(zip(lines, fits, strict=True)):
        line.set(label=it.bsdf["type"], color=COLOURS[k])  # the report's colours are those of its style sheet
    data.set(label="measured", color=INK)
    mirror.set(label="mirror direction")
    figure.set_size_inches(4, 3)
    figure.axes[0].set(xscale="linear", xlim=(-90, 90), xticks=range(-90, 91, 30), xlabel=r"$\theta_o$ in degrees")
    figure.axes[0].set_title(incidence(70), fontsize=TEXT, color=INK)
    figure.axes[0].legend(frameon=False, fontsize=9)
    return _image(figure)


class Tilted(LambertLobe):
    """A sampler that leaves out light from one side."""

    def sample(self, wi: mi.Vector3f, u: mi.Float, v: mi.Point2f) -> mi.Vector3f:
        wo = super().sample(wi, u, v)
        return mi.Vector3f(abs(wo.x), wo.y, wo.z)


class Faulty(Lambert):
    """A model with a fault."""

    def lobes(self, p):
        return (Tilted(p.reflectance),)


def _checker() -> Image.Image:
    """What the sampler of a faulty model draws, what its density expects, and the difference."""
    Faulty.plugins = ("faulty",)
    mi_brdfs.register(Faulty)
    _, figure, *_ = next(drawn(check("faulty", only=["chi2"], angles=(40,)).trials[0]))
    figure.set_layout_engine("none")
    figure.set_size_inches(4, 3)
    for ax, place in zip(
        figure.axes, ((0, 0.58, 0.36, 0.36), (0, 0.06, 0.36, 0.36), (0.4, 0.17, 0.6, 0.7)), strict=True
    ):
        ax.set_position(place)
        for ring in ax.lines[-2:]:  # around the worst direction, which a report names
            ring.remove()
    drawn_, _, difference = figure.axes
    drawn_.set_title("drawn", loc="left", fontsize=SMALL, pad=3)
    difference.set_title("red: drawn too often\nblue: too rarely", loc="left", fontsize=SMALL, pad=3)
    for place, text in ((-40, "wi"), (40, "mirror")):
        difference.annotate(
            text, (place, 0), (0, 7), textcoords="offset points", color="white", fontsize=SMALL, ha="center"
        )
    scale, colours = figure.add_axes((0.55, 0.09, 0.3, 0.03)), ScalarMappable(Normalize(-5, 5), DIFFERENCE)
    figure.colorbar(colours, cax=scale, orientation="horizontal", ticks=(-5, 0, 5), format="%dσ")
    scale.tick_params(labelsize=SMALL, length=0)
    return _image(figure)


def _globe() -> Image.Image:
    """The globe of the scene with a texture for each parameter, without the cards beside it."""
    look_at = mi.ScalarTransform4f().look_at(origin=[-2.5, -12, 3.2], target=[-2.5, 0, 1.75], up=[0, 0, 1])
    film = {"type": "hdrfilm", "width": SIZE[0], "height": SIZE[1], "rfilter": {"type": "box"}}
    sensor = mi.load_dict({"type": "perspective", "fov": 25.3, "to_world": look_at, "film": film})
    image = mi.render(mi.load_file(str(GLOBE)), sensor=sensor, spp=128)
    return Image.fromarray(np.array(display_image(mi.Bitmap(denoise(np.array(image)[..., :3])))))


def _published() -> Image.Image:
    """Some of the balls that the explorer shows of published materials."""
    return Image.open(BALLS).crop((0, 0, 12 * BALL, 9 * BALL)).resize(SIZE, Image.Resampling.LANCZOS)


PARTS = {".frame >> nth=0": (6, 6, 232), ".frame >> nth=1": (6, 242, 232), ".figure.polar": (244, 24, 390),
         "#view-polar .readout": (250, 282, 378), ".control.number >> nth=0": (250, 372, 378)}  # fmt: skip
"""What is shown of the explorer's page: where, and how wide."""


def _explorer() -> Image.Image:
    """Parts of the explorer's page in Chromium: pictures and lobes of two metals, and a slider; dark, as renderings
    are, to suit both schemes of the site."""
    from playwright.sync_api import sync_playwright

    command = [sys.executable, "-m", "mi_brdfs", "explore", *SHOWN, "--no-browser", "--port", "0"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        address = server.stdout.readline().strip()
        with sync_playwright() as running:
            chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
            flags = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
            page = running.chromium.launch(executable_path=chromium, args=flags).new_page(
                viewport={"width": 1280, "height": 960}, device_scale_factor=2, color_scheme="dark"
            )
            page.goto(address)
            page.get_by_text("denoised").nth(1).wait_for(timeout=600_000)
            ground = "it => getComputedStyle(it.closest('.card')).backgroundColor"
            shown = Image.new("RGB", SIZE, page.locator(".figure.polar").evaluate(ground))
            for place, (x, y, width) in PARTS.items():
                part = Image.open(io.BytesIO(page.locator(place).screenshot()))
                size = width, round(width * part.height / part.width)
                shown.paste(part.resize(size, Image.Resampling.LANCZOS), (x, y))
            return shown
    finally:
        server.terminate()
        server.wait(20)
