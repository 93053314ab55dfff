"""The adapter between an integrator's physics and Mitsuba: the only place that knows ``mi.SamplingIntegrator``."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from ..variants import is_scalar


class PixelCentreIntegrator:
    """An integrator that traces rays through pixel centres, so that only what its physics draws is random.

    The physics has two methods. ``shade(scene, sampler, ray, active)`` returns the unpolarized radiance along a ray,
    and its opacity; ``finish(colour)`` maps the mean of a pixel's samples to its final colour.

    A picture takes two steps, :meth:`sums` and :meth:`put`, so that any number of passes may add up before the finish.
    """

    plugin_class: type[Any]

    def __init__(self, props: mi.Properties) -> None:
        mi.SamplingIntegrator.__init__(self, props)
        self.physics = self.plugin_class(props)
        self.textures = self.physics.textures  # a member, as in ModelBSDF

    def sample(
        self,
        scene: mi.Scene,
        sampler: mi.Sampler,
        ray: mi.RayDifferential3f,
        medium: Any = None,
        active: mi.Bool = True,
    ) -> Any:
        """Return what other integrators, such as ``aov``, see along a ray: each of their samples is finished."""
        radiance, opacity = self.physics.shade(scene, sampler, ray, active)
        return mi.depolarizer(self.physics.finish(radiance)), opacity > 0, []

    def render(
        self, scene: mi.Scene, sensor: Any = 0, seed: int = 0, spp: int = 0, develop: bool = True, evaluate: bool = True
    ) -> mi.TensorXf:
        sensor, film, sampler = self._opened(scene, sensor, spp)
        self.put(film, self.sums(scene, sensor, seed, spp), sampler.sample_count())
        if not develop:
            film.schedule_storage()
            return mi.TensorXf()
        image = film.develop()
        if evaluate:
            dr.eval(image)
            dr.sync_thread()
        return image

    def sums(self, scene: mi.Scene, sensor: Any, seed: int = 0, spp: int = 0) -> Any:
        """Return the sums over the samples of each pixel: red, green, blue and opacity, before the finish.

        The sums of different seeds may be added. The memory needed does not depend on ``spp``, unless derivatives are
        recorded; ``mi.render`` does not record them over several passes.
        """
        sensor, film, sampler = self._opened(scene, sensor, spp)
        if mi.has_flag(film.flags(), mi.FilmFlags.Special):
            raise ValueError(
                f"{self.physics.plugins[0]}: {film.class_name()} has no colours to finish; use an hdrfilm."
            )
        if is_scalar():
            totals, pixel = [], pixels(film)
            for index, corner in enumerate(pixel):
                sampler.seed(seed * len(pixel) + index)
                total = [0.0] * 4
                for _ in range(sampler.sample_count()):
                    total = [a + b for a, b in zip(total, self._look(scene, sensor, sampler, corner), strict=True)]
                    sampler.advance()
                totals.append(total)
            return np.array(totals)

        total = mi.Vector4f(0)
        for index, passed in enumerate(self._passes(scene, sensor, sampler, seed)):
            total += passed
            if index:
                dr.eval(total)
        return total

    def _passes(self, scene: mi.Scene, sensor: Any, sampler: mi.Sampler, seed: int) -> Iterator[mi.Vector4f]:
        """Yield the sums of the samples of each pass, in bounded memory, in vectorized variants."""
        pixel, spp, at_once = pixels(sensor.film()), sampler.sample_count(), samples_at_once(sensor.film(), sampler)
        count = dr.width(pixel)
        sampler.set_samples_per_wavefront(at_once)
        sampler.seed(seed, count * at_once)
        corner = dr.repeat(pixel, at_once)
        for _ in range(spp // at_once):
            samples = self._look(scene, sensor, sampler, corner)
            if at_once > 1:
                dr.eval(samples)  # together: each sum would evaluate its terms separately
            passed = mi.Vector4f([added(value, count, at_once) for value in samples])
            del samples
            if at_once < spp:
                sampler.advance()
                sampler.schedule_state()
                dr.eval(passed)
            yield passed
            if at_once < spp:
                dr.sync_thread()  # otherwise all passes would allocate before the first frees its memory

    def render_backward(
        self, scene: mi.Scene, params: Any, grad_in: Any, sensor: Any = 0, seed: int = 0, spp: int = 0
    ) -> None:
        """Do as Mitsuba's own, but pass by pass, by the derivative of the finish at the mean of all."""
        sensor, film, sampler = self._opened(scene, sensor, spp)
        if samples_at_once(film, sampler) == sampler.sample_count():
            return mi.SamplingIntegrator.render_backward(self, scene, params, grad_in, sensor, seed, spp)
        with dr.suspend_grad():
            sums = self.sums(scene, sensor, seed, spp)
        dr.enable_grad(sums)
        self.put(film, sums, sampler.sample_count())
        dr.backward_from(film.develop() * grad_in)
        adjoint = dr.grad(sums)
        with dr.scoped_set_flag(dr.JitFlag.SymbolicLoops, False):  # recorded loops cannot be differentiated
            for passed in self._passes(scene, sensor, sampler, seed):
                dr.backward_from(dr.dot(passed, adjoint))
                dr.eval()

    def render_forward(self, scene: mi.Scene, params: Any, sensor: Any = 0, seed: int = 0, spp: int = 0) -> Any:
        """Do as Mitsuba's own, but pass by pass."""
        sensor, film, sampler = self._opened(scene, sensor, spp)
        sums, tangent = mi.Vector4f(0), mi.Vector4f(0)
        # Recorded calls whose results come to nothing, as beside masks, cannot be differentiated in this direction.
        recorded = dr.JitFlag.SymbolicLoops, dr.JitFlag.SymbolicCalls
        with dr.scoped_set_flag(recorded[0], False), dr.scoped_set_flag(recorded[1], False):
            for passed in self._passes(scene, sensor, sampler, seed):
                # Later passes need the gradients of the parameters, too.
                tangent += dr.forward_to(passed, flags=dr.ADFlag.ClearEdges | dr.ADFlag.ClearInterior)
                sums += dr.detach(passed)
                dr.eval(sums, tangent)
        dr.enable_grad(sums)
        dr.set_grad(sums, tangent)
        self.put(film, sums, sampler.sample_count())
        return dr.forward_to(film.develop())

    def put(self, film: mi.Film, sums: Any, count: Any) -> None:
        """Fill a film with the finished means of its pixels: ``sums`` over ``count`` samples, each pixel's weight."""
        film.prepare([])
        block, has_alpha = film.create_block(), mi.has_flag(film.flags(), mi.FilmFlags.Alpha)
        # A box filter needs the corner, as in Mitsuba's own integrators.
        centre = 0 if film.rfilter().is_box_filter() else 0.5
        scalar = is_scalar()
        for corner, total in zip(pixels(film), sums, strict=True) if scalar else [(pixels(film), sums)]:
            *colour, opacity = (mi.Float(value) for value in total)
            colour = self.physics.finish(mi.Color3f(colour) / count) * count
            block.put(corner + centre, [*colour, *([opacity] if has_alpha else []), mi.Float(count)])
        film.put_block(block)

    @staticmethod
    def _opened(scene: mi.Scene, sensor: Any, spp: int) -> tuple[Any, mi.Film, mi.Sampler]:
        """Return a sensor, which may be given by its index, its film, and a clone of its sampler, for ``spp`` samples
        per pixel or the scene's number."""
        if isinstance(sensor, int):
            sensor = scene.sensors()[sensor]
        sampler = sensor.sampler().clone()
        if spp:
            sampler.set_sample_count(spp)
        return sensor, sensor.film(), sampler

    def _look(self, scene: mi.Scene, sensor: Any, sampler: mi.Sampler, corner: Any) -> list[mi.Float]:
        """Return the red, green and blue of a sample through the centre of a pixel, and its opacity."""
        film, time = sensor.film(), sensor.shutter_open()
        if sensor.shutter_open_time() > 0:
            time += sampler.next_1d() * sensor.shutter_open_time()
        # If the sensor is a surface, its film has no pixel centres, but spreads over the surface.
        inside = 0.5 if sensor.get_shape() is None else sampler.next_2d()
        ray, weight = sensor.sample_ray_differential(
            time=time,
            sample1=sampler.next_1d() if mi.is_spectral else 0,
            sample2=(corner + inside - film.crop_offset()) / mi.ScalarVector2f(film.crop_size()),
            sample3=sampler.next_2d() if sensor.needs_aperture_sample() else mi.Point2f(0.5),
        )
        radiance, opacity = self.physics.shade(scene, sampler, ray, mi.Bool(True))
        colour = mi.unpolarized_spectrum(weight) * radiance
        if mi.is_spectral:
            colour = mi.spectrum_to_srgb(colour, ray.wavelengths)
        elif mi.is_monochromatic:
            colour = mi.Color3f(colour[0])
        return [*colour, opacity]

    def traverse(self, callback: mi.TraversalCallback) -> None:
        for name, texture in self.textures.items():
            callback.put(name, texture, mi.ParamFlags.Differentiable)

    def to_string(self) -> str:
        return self.physics.described()


LANES = 1 << 22
"""The most samples drawn at once, unless the film has more pixels: fixed, as the samples depend on it."""


def pixels(film: mi.Film) -> Any:
    """Return the corners of a film's pixels, with the border that its filter may need: a list in scalar variants."""
    border = film.rfilter().border_size() if film.sample_border() else 0
    width, height = (int(size) + 2 * border for size in film.crop_size())
    first = mi.ScalarVector2i(film.crop_offset()) - border
    if is_scalar():
        return [mi.Point2f(x, y) + first for y in range(height) for x in range(width)]
    index = dr.arange(mi.UInt32, width * height)
    return mi.Point2f(mi.Point2u(index % width, index // width)) + first


def samples_at_once(film: mi.Film, sampler: mi.Sampler) -> int:
    """Return the samples of each pixel drawn at once: a divisor of all, as samplers that stratify over passes need."""
    spp, most = sampler.sample_count(), max(LANES // dr.width(pixels(film)), 1)
    return next(count for count in range(min(spp, most), 0, -1) if spp % count == 0)


def added(value: Any, count: int, size: int) -> mi.Float:
    """Return the sums of ``count`` blocks of a value, each of a given size; the value may be uniform."""
    return dr.block_sum(value, size) if dr.width(value) == count * size else dr.repeat(value * size, count)
