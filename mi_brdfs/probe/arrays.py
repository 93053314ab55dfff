"""NumPy arrays as arguments of a BSDF's methods, and what these return as arrays, in any variant."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..variants import is_scalar

Array = NDArray[Any]

CENTRE = 0.4, 0.3
"""The texture coordinates of what is measured where no others are given."""
WAVELENGTHS = 450, 520, 580, 640
"""Those of spectral variants, in nanometres."""
VISIBLE = 360, 830
"""The range of Mitsuba's wavelengths, in nanometres."""
ALIGNMENT = 64
"""Of Dr.Jit's arrays, in bytes."""


def context(component: int | None = None, mask: int | None = None) -> mi.BSDFContext:
    """Return a BSDF context, restricted to one component or to some types if they are given."""
    result = mi.BSDFContext()
    if component is not None:
        result.component = component
    if mask is not None:
        result.type_mask = int(mask)
    return result


def interaction(wi: ArrayLike, uv: ArrayLike = CENTRE, wavelengths: ArrayLike = WAVELENGTHS) -> mi.SurfaceInteraction3f:
    """Return a surface interaction for directions ``wi`` of the local frame, shape (3,) or (N, 3), at texture
    coordinates ``uv``, shape (2,) or (N, 2), and in spectral variants for four ``wavelengths``, shape (4,) or (N, 4).
    """
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wi = vectors(wi)
    si.n = mi.Normal3f(0, 0, 1)
    si.sh_frame = mi.Frame3f(mi.Vector3f(0, 0, 1))
    si.dp_du, si.dp_dv = mi.Vector3f(1, 0, 0), mi.Vector3f(0, 1, 0)
    si.uv = mi.Point2f(uv) if np.ndim(uv) == 1 else mi.Point2f(columns_of(uv))
    if mi.is_spectral:
        columns = list(wavelengths) if isinstance(wavelengths, tuple) else columns_of(wavelengths)
        si.wavelengths = mi.UnpolarizedSpectrum(*columns)
    return si


def vectors(w: ArrayLike) -> mi.Vector3f:
    """Return directions of shape (3,) or (N, 3) as a vector that Dr.Jit compiles no new kernel for."""
    result = mi.Vector3f(columns_of(w))
    if not is_scalar():
        dr.make_opaque(result)
    return result


def sample_arguments(variates: Array) -> tuple[mi.Float, mi.Point2f]:
    """Return rows of three uniform variates, shape (N, 3), as the two arguments of ``sample``; vectorized only."""
    return floats(variates[:, 0]), mi.Point2f(columns_of(variates[:, 1:]))


def hero_wavelengths(count: int) -> Array:
    """Return four wavelengths for each lane that divide the visible range, all of which the lanes fill, as integrators
    sample them; shape (count, 4)."""
    first = np.arange(count)[:, None] * 0.6180339887498949  # the golden ratio spreads any part of the lanes
    return (VISIBLE[0] + np.diff(VISIBLE) * ((first + np.arange(4) / 4) % 1)).astype(np.float32)


def texture(**methods: Callable[..., Any]) -> mi.Texture:
    """Return a texture that has some methods, whose first argument is the texture itself."""
    return type("Made", (mi.Texture,), methods)(mi.Properties())


def per_lane() -> mi.Texture:
    """Return a texture whose ``value``, a float or a colour, may differ from lane to lane."""

    def evaluated(self: Any, si: mi.SurfaceInteraction3f, active: mi.Bool = True) -> Any:
        return self.value

    return texture(eval=evaluated, eval_1=evaluated)


@contextmanager
def held(textures: Mapping[str, mi.Texture], values: Mapping[str, Any]) -> Iterator[None]:
    """Give textures of :func:`per_lane` values, and afterwards zeros: a plugin that lives on, be it in a traceback
    alone, is part of other kernels."""
    try:
        for name, texture in textures.items():
            texture.value = values[name]
        yield
    finally:
        for name, texture in textures.items():
            texture.value = type(values[name])(0)


def pinned(varying: mi.Texture, si: mi.SurfaceInteraction3f, channel: int | None = None) -> mi.Texture:
    """Return a texture that has, whatever it is asked for, the values of another one at ``si``, lane by lane; as a
    colour, grey of one channel if that is given."""

    def at(method: str, of: int | None = None) -> Callable[..., Any]:
        def evaluated(self: mi.Texture, _: mi.SurfaceInteraction3f, active: mi.Bool = True) -> Any:
            value = getattr(varying, method)(si, active)
            return value if of is None else type(value)(value[of])

        return evaluated

    return texture(
        eval=at("eval", channel),
        eval_1=at("eval_1"),
        eval_1_grad=at("eval_1_grad"),
        eval_3=at("eval_3", channel),
        mean=lambda self: 0.5 * varying.mean(),  # samplers may be guided by it, but values that follow it show
        max=lambda self: varying.max(),
        is_spatially_varying=lambda self: True,
    )


def numbers(value: Any, count: int | None = None) -> Array:
    """Return a float, vector, spectrum or Mueller matrix (of which the first entry counts) as float64 of shape
    (count, channels), by default with as many rows as it has lanes."""
    if mi.is_polarized and isinstance(value, mi.Spectrum):
        value = value[0, 0]
    if dr.depth_v(value) > 1:
        dr.eval(value)
        # By channel: for all at once, Dr.Jit compiles a kernel for each number of lanes.
        array = np.array(np.broadcast_arrays(*map(np.array, value)), np.float64)
    else:
        array = np.array(value, np.float64)
    if array.ndim < 2:
        array = array.reshape((-1, 1) if is_scalar() else (1, -1))
    return array.T if count is None else np.broadcast_to(array, (len(array), count)).T


def all_numbers(values: Iterable[Any], count: int) -> list[Array]:
    """Return :func:`numbers` of several values that share most of their code, which one kernel computes."""
    values = list(values)
    dr.eval(values)
    return [numbers(value, count) for value in values]


def luminance(colours: Array) -> Array:
    """Return the luminance of rgb colours, shape (…, 3), and the mean of what has other channels."""
    return colours @ [0.212671, 0.715160, 0.072169] if colours.shape[-1] == 3 else colours.mean(axis=-1)


def floats(x: ArrayLike) -> mi.Float:
    """Return numbers of shape (N,) as an array of a vectorized variant, aligned as Dr.Jit's own arrays are: it uses
    NumPy's memory, and would compile a kernel anew for each combination of inputs that are aligned and that are not."""
    x = np.asarray(x, np.float32)
    memory = np.empty(x.nbytes + ALIGNMENT, np.uint8)
    first = -memory.ctypes.data % ALIGNMENT
    aligned = memory[first : first + x.nbytes].view(np.float32)
    aligned[:] = x
    return mi.Float(aligned)


def launched_kernels(work: Callable[[], object]) -> set[int]:
    """Return the kernels that some work launches, by hash: whether one is compiled depends on the cache that earlier
    runs left. ``dr.JitFlag.KernelHistory`` must be set."""
    dr.kernel_history_clear()
    work()
    return {kernel["hash"] for kernel in dr.kernel_history([dr.KernelType.JIT])}


def columns_of(rows: ArrayLike) -> Any:
    """Return rows as the columns that Dr.Jit's arrays are made of, and a single row as it is."""
    columns = np.asarray(rows, np.float32).T
    return columns if columns.ndim == 1 else [floats(column) for column in columns]
