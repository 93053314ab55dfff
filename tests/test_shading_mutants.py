"""Bugs planted into ``shading``, each of which a check of its tests must notice."""

import mitsuba as mi
import pytest
import test_shading_films as films
import test_shading_passes as passes
import test_shading_through as through

from mi_brdfs.integrators import shading
from mi_brdfs.mitsuba import integrator as adapter


def finish_each_pass(sums):
    def finished(self, scene, sensor, seed=0, spp=0):
        total = sums(self, scene, sensor, seed, spp)
        return mi.Vector4f(*self.physics.finish(mi.Color3f(total.xyz) / spp) * spp, total.w)

    return finished


def finish_each_sample(look):
    def finished(self, *given):
        *colour, opacity = look(self, *given)
        return [*self.physics.finish(mi.Color3f(colour)), opacity]

    return finished


def finish_nothing(finish):
    return lambda self, colour: colour


def weigh_the_last_pass_like_the_others(sums):
    return lambda self, scene, sensor, seed, spp: sums(self, scene, sensor, seed, spp) * (4 / spp)


def put_sums_as_means(put):
    return lambda self, film, sums, count: put(self, film, sums, 1)


def draw_all_at_once(sums):
    def at_once(self, *given):
        lanes, adapter.LANES = adapter.LANES, 1 << 40
        try:
            return sums(self, *given)
        finally:
            adapter.LANES = lanes

    return at_once


def look_through_corners(look):
    return lambda self, scene, sensor, sampler, corner: look(self, scene, sensor, sampler, corner - 0.5)


def forget_the_border(pixels):
    return lambda film: pixels(film) + (film.rfilter().border_size() if film.sample_border() else 0)


def count_what_all_lanes_share_once(added):
    return lambda value, count, size: added(value, count, size) / size


def block_what_is_behind(may_pass):
    return lambda scene: False


def shine_through_everything(straight_through):
    return lambda *given: mi.UnpolarizedSpectrum(1)


def add_layers_in_full(null_transmission):
    return lambda si, active: mi.UnpolarizedSpectrum(null_transmission(si, active) > 0)


INTEGRATOR = "the integrator's class"
MUTANTS = [
    (finish_each_pass, INTEGRATOR, "sums", passes.check_finish),
    (finish_each_sample, INTEGRATOR, "_look", passes.check_finish),
    (finish_nothing, shading.Shading, "finish", passes.check_finish),
    (weigh_the_last_pass_like_the_others, INTEGRATOR, "sums", passes.check_finish),
    (put_sums_as_means, INTEGRATOR, "put", passes.check_finish),
    (draw_all_at_once, INTEGRATOR, "sums", passes.test_memory_does_not_grow_with_samples),
    (look_through_corners, INTEGRATOR, "_look", films.check_pixels),
    (forget_the_border, adapter, "pixels", lambda: films.check_pixels("gaussian", border=True)),
    (count_what_all_lanes_share_once, adapter, "added", films.test_nothing_is_transparent_under_an_environment),
    (block_what_is_behind, shading, "may_pass", through.check_masks),
    (shine_through_everything, shading, "straight_through", through.check_masks),
    (add_layers_in_full, shading, "null_transmission", through.check_layers),
]
"""The change of a function, whose it is, its name, and the check that must notice. That the check passes without the
change is a test of its own."""


@pytest.mark.slow
@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("mutant, owner, name, check", MUTANTS, ids=lambda it: getattr(it, "__name__", ""))
def test_a_check_notices(mutant, owner, name, check, monkeypatch):
    owner = type(mi.load_dict({"type": "shading"})) if owner is INTEGRATOR else owner
    monkeypatch.setattr(owner, name, mutant(getattr(owner, name)))
    with pytest.raises(AssertionError):
        check(*([monkeypatch] if check.__module__ == passes.__name__ else []))
