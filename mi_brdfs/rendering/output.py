"""What becomes of a rendered picture: denoised, tone-mapped, written."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable
from pathlib import Path

import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike

from ..writing import replacing
from .passes import Picture

SHOULDER = 0.8
IMAGES = {
    ".exr": "OpenEXR", ".png": "PNG", ".jpg": "JPEG", ".jpeg": "JPEG", ".hdr": "RGBE", ".pfm": "PFM", ".ppm": "PPM",
}  # fmt: skip
"""Mitsuba's formats by the endings of file names."""


def denoise(colours: np.ndarray | mi.TensorXf | mi.Bitmap) -> np.ndarray:
    """Return linear RGB, shape (height, width, 3), or luminance, shape (height, width, 1), denoised by Intel's Open
    Image Denoise. Films with a box filter give the best result, as pixels then share no samples. Values that are
    infinite or no numbers stay, and count as 0 for those beside them.

    Raises:
        ImportError: without the extra that brings it.
        ValueError: if the shape is another one, or they are no floats, as those of a PNG, which are not linear.
    """
    try:
        import mitsuba_oidn
    except ImportError as error:
        raise ImportError('denoising needs the extra of this name: pip install "mi_brdfs[denoise]"') from error
    pixels = np.array(colours, order="C")
    if not np.issubdtype(pixels.dtype, np.floating):
        raise ValueError(f"denoise takes linear colours as floats, not {pixels.dtype}")
    pixels = pixels.astype(np.float32)
    if pixels.ndim != 3 or pixels.shape[2] not in (1, 3) or not pixels.size:
        raise ValueError(f"denoise takes colours of the shape (height, width, 3 or 1), not {pixels.shape}")
    height, width, _ = pixels.shape
    finite = np.isfinite(pixels)
    # It leaves lines along the edges where sides are no multiples of 16.
    padded = np.pad(np.where(finite, pixels, 0), ((0, -height % 16), (0, -width % 16), (0, 0)), mode="symmetric")
    return np.where(finite, mitsuba_oidn.denoise(padded, hdr=True)[:height, :width], pixels)


def denoiser() -> Callable[[np.ndarray], np.ndarray] | None:
    """Return :func:`denoise` if what it needs is installed and loads."""
    try:
        import mitsuba_oidn  # noqa: F401
    except ImportError:
        return None
    return denoise


def denoised(picture: Picture) -> Picture:
    """Return a picture whose colours are denoised (:func:`denoise`); alpha and AOVs are as before.

    Raises:
        ImportError: without the extra that brings the denoiser.
        ValueError: if the film has no RGB channels.
    """
    names = [field.name for field in picture.bitmap.struct_()]
    if names[:3] != ["R", "G", "B"]:
        raise ValueError("only films with the pixel format rgb or rgba can be denoised")
    pixels = np.array(picture.bitmap, np.float32).reshape(*reversed(picture.bitmap.size()), -1)
    pixels[..., :3] = denoise(pixels[..., :3])
    bitmap = mi.Bitmap(pixels, picture.bitmap.pixel_format(), names)
    return dataclasses.replace(picture, image=mi.TensorXf(pixels), bitmap=bitmap)


def tonemap(image: np.ndarray, peak: float | None = None) -> np.ndarray:
    """Map linear RGB of any range to [0, 1], still linear, without flat highlights or hue shifts.

    With ``m`` the largest of a pixel's channels and ``p`` the ``peak``, by default the 99.9th percentile of ``m``, a
    pixel is multiplied by ``f(m) / m``. Up to 0.8, and everywhere if ``p <= 1``, ``f(m) = m``: a well exposed picture
    stays as it is. Above,

        f(m) = 0.8 + 0.2 t (1 + t/T²) / (1 + t),    t = (m - 0.8) / 0.2,    T = (p - 0.8) / 0.2,

    which continues with slope 1 and reaches 1 at ``m = p``. Brighter pixels are scaled to 1; negative values and NaNs
    become 0.
    """
    image = np.minimum(np.nan_to_num(np.maximum(image, 0), nan=0.0), 1e30)  # which leaves float32 room
    m = image.max(axis=-1, keepdims=True)
    p = np.percentile(m, 99.9) if peak is None else peak
    T = max((p - SHOULDER) / (1 - SHOULDER), 1.0)
    t = np.maximum(m - SHOULDER, 0) / (1 - SHOULDER)
    f = np.where(m > SHOULDER, SHOULDER + (1 - SHOULDER) * t * (1 / (1 + t) + t / (1 + t) / T / T), m)
    return image * np.minimum(f, 1) / np.where(m > 0, m, 1)


def display_image(bitmap: mi.Bitmap | ArrayLike) -> mi.Bitmap | None:
    """Return the tone-mapped 8-bit sRGB image of a developed film, without alpha and AOVs; None without colours. The
    film is given as a bitmap, or as an array of up to four channels: those of more have no names. Bytes are sRGB, as in
    a PNG, and so is a bitmap that says so."""
    if not isinstance(bitmap, mi.Bitmap):
        pixels = np.array(bitmap)
        bitmap = mi.Bitmap(pixels if pixels.dtype == np.uint8 else pixels.astype(np.float32))
    names = "".join(field.name for field in bitmap.struct_())
    formats = (mi.Bitmap.PixelFormat.RGB, mi.Bitmap.PixelFormat.XYZ, mi.Bitmap.PixelFormat.Y)
    colours = next((it for it in formats if names.startswith(it.name)), None)
    if colours is None:
        return None
    pixels = np.array(bitmap).reshape(*reversed(bitmap.size()), -1)[..., : len(colours.name)]
    chosen = mi.Bitmap(np.ascontiguousarray(pixels), colours)
    chosen.set_srgb_gamma(bitmap.srgb_gamma())
    linear = chosen.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, srgb_gamma=False)
    mapped = mi.Bitmap(tonemap(np.array(linear)).astype(np.float32), mi.Bitmap.PixelFormat.RGB)
    return mapped.convert(component_format=mi.Struct.Type.UInt8, srgb_gamma=True)


def broken_pixels(picture: Picture) -> int:
    """Return how many pixels have values that are infinite or no numbers."""
    return int((~np.isfinite(np.array(picture.bitmap))).reshape(picture.bitmap.pixel_count(), -1).any(axis=1).sum())


def write(bitmap: mi.Bitmap, path: str | os.PathLike) -> None:
    """Write ``bitmap`` in the format of the file name, all or nothing: ``path`` never holds half an image.

    Raises:
        ValueError: if the name ends in no format.
        OSError: if it cannot be written.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in IMAGES:
        raise ValueError(f"{path}: unknown image format; use {', '.join(IMAGES)}")
    # Mitsuba takes only file names in UTF-8, and does not notice if the last 8 KB find no room on the disk.
    with replacing(path) as part:
        part.write_bytes(encoded(bitmap, IMAGES[suffix]))


def encoded(bitmap: mi.Bitmap, format: str, quality: int = -1) -> bytes:
    """Return what a file of a format holds, by its name in ``mitsuba.Bitmap.FileFormat``."""
    stream = mi.MemoryStream()
    bitmap.write(stream, getattr(mi.Bitmap.FileFormat, format), quality)
    return stream.raw_buffer()
