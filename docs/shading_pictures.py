"""Write the pictures of scenes/shading/README.md: each scene shaded, and below it path-traced.

python docs/shading_pictures.py
"""

from __future__ import annotations

from pathlib import Path

import mi_brdfs  # noqa: F401
from mi_brdfs.render import display_image

import mitsuba as mi  # after mi_brdfs, which chooses the LLVM that it loads  # isort: skip

import numpy as np

ROOT = Path(__file__).parents[1]
SCENES = sorted((ROOT / "scenes" / "shading").glob("*.xml"))
PICTURES = ROOT / "docs" / "scenes" / "shading"
FINER, SAMPLES, QUALITY = 3, 1024, 88


def picture(path: Path, spp: int = SAMPLES) -> mi.Bitmap:
    """The scene shaded, in three times as many pixels a side and made smaller for smooth edges, over the same scene
    traced."""
    scene = mi.load_file(str(path))
    width, height = scene.sensors()[0].film().size()
    fine = mi.load_file(str(path), width=str(FINER * width), height=str(FINER * height))
    shaded = np.array(mi.render(fine, spp=1)).reshape(height, FINER, width, FINER, 3).mean(axis=(1, 3))
    traced = np.array(mi.render(scene, integrator=mi.load_dict({"type": "path", "max_depth": 5}), spp=spp))
    return display_image(mi.Bitmap(np.concatenate([shaded, traced])))


def main():
    mi.set_variant("llvm_ad_rgb")
    for path in SCENES:
        picture(path).write(str(PICTURES / f"{path.stem}.jpg"), quality=QUALITY)


if __name__ == "__main__":
    main()
