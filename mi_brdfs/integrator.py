"""The adapter between an integrator's physics and Mitsuba: the only place that knows ``mi.SamplingIntegrator``."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi

from .model import Plugin


def integrator_class(physics: type[Plugin], base: type) -> type:
    """The integrator class of some physics for one variant, of which ``base`` is the ``mi.SamplingIntegrator``.

    As with :func:`mi_brdfs.bsdf.bsdf_class`, the methods are written once below and handed to the class of each
    variant.
    """
    methods = {
        name: value for name, value in vars(CentredIntegrator).items() if name not in ("__dict__", "__weakref__")
    }
    return type(physics.__name__, (base,), {**methods, "physics_class": physics})


class CentredIntegrator:
    """An integrator that looks through the centres of the pixels, so that nothing is random but what its physics draws.

    The physics has two methods. ``shade(scene, sampler, ray, active)`` returns the unpolarized radiance along a ray,
    and whether something was seen; ``finish(colour)`` is what becomes of the mean of a pixel's samples.
    """

    physics_class: type[Plugin]

    def __init__(self, props):
        mi.SamplingIntegrator.__init__(self, props)
        self.physics = self.physics_class(props)
        self.textures = self.physics.textures  # a member, as in ModelBSDF

    def sample(self, scene, sampler, ray, medium=None, active=True):
        """What other integrators, such as ``aov``, see along a ray: each of their samples is finished."""
        radiance, seen = self.physics.shade(scene, sampler, ray, active)
        return mi.depolarizer(self.physics.finish(radiance)), seen, []

    def render(self, scene, sensor=0, seed=0, spp=0, develop=True, evaluate=True):
        if isinstance(sensor, int):
            sensor = scene.sensors()[sensor]
        film, sampler = sensor.film(), sensor.sampler().clone()
        if mi.has_flag(film.flags(), mi.FilmFlags.Special):
            raise ValueError(
                f"{self.physics.plugins[0]}: {film.class_name()} has no colours to finish; take an hdrfilm."
            )
        if spp:
            sampler.set_sample_count(spp)
        spp = sampler.sample_count()
        border = film.rfilter().border_size() if film.sample_border() else 0
        width, height = (int(size) + 2 * border for size in film.crop_size())
        corner = mi.ScalarVector2i(film.crop_offset()) - border
        film.prepare([])
        block = film.create_block()

        if mi.variant().startswith("scalar"):
            for index in range(width * height):
                pixel = mi.Point2f(index % width, index // width) + corner
                sampler.seed(seed * width * height + index)
                total = [0.0] * 4
                for _ in range(spp):
                    total = [a + b for a, b in zip(total, self._look(scene, sensor, sampler, pixel), strict=True)]
                    sampler.advance()
                self._put(block, film, pixel, total, spp)
        else:
            sampler.set_samples_per_wavefront(spp)
            sampler.seed(seed, width * height * spp)
            index = dr.arange(mi.UInt32, width * height)
            pixel = mi.Point2f(mi.Point2u(index % width, index // width)) + corner
            samples = self._look(scene, sensor, sampler, dr.repeat(pixel, spp))
            self._put(block, film, pixel, [dr.block_sum(value, spp) for value in samples], spp)

        film.put_block(block)
        if not develop:
            film.schedule_storage()
            return mi.TensorXf()
        image = film.develop()
        if evaluate:
            dr.eval(image)
            dr.sync_thread()
        return image

    def _look(self, scene, sensor, sampler, pixel):
        """The red, green and blue of a sample, and its opacity, through the centre of a pixel, given by its corner."""
        film, time = sensor.film(), sensor.shutter_open()
        if sensor.shutter_open_time() > 0:
            time += sampler.next_1d() * sensor.shutter_open_time()
        ray, weight = sensor.sample_ray_differential(
            time=time,
            sample1=sampler.next_1d() if mi.is_spectral else 0,
            sample2=(pixel + 0.5 - film.crop_offset()) / mi.ScalarVector2f(film.crop_size()),
            sample3=sampler.next_2d() if sensor.needs_aperture_sample() else mi.Point2f(0.5),
        )
        radiance, seen = self.physics.shade(scene, sampler, ray, mi.Bool(True))
        colour = mi.unpolarized_spectrum(weight) * radiance
        if mi.is_spectral:
            colour = mi.spectrum_to_srgb(colour, ray.wavelengths)
        elif mi.is_monochromatic:
            colour = mi.Color3f(colour[0])
        return [*colour, dr.select(seen, mi.Float(1), mi.Float(0))]

    def _put(self, block, film, pixel, total, spp):
        """Add the finished mean to a block, with the weight of its samples, of which ``total`` is the sum."""
        *colour, alpha = total
        colour = self.physics.finish(mi.Color3f(colour) / spp) * spp
        channels = [*colour, alpha, spp] if mi.has_flag(film.flags(), mi.FilmFlags.Alpha) else [*colour, spp]
        # A box filter takes the corner, as Mitsuba's own integrators do.
        position = pixel if film.rfilter().is_box_filter() else pixel + 0.5
        block.put(position, [mi.Float(value) for value in channels])

    def traverse(self, callback):
        for name, texture in self.textures.items():
            callback.put(name, texture, mi.ParamFlags.Differentiable)

    def to_string(self):
        return self.physics.described()
