"""Bugs planted into ``shading``, each of which a check of its tests must notice."""

import mitsuba as mi
import pytest
from test_shading_films import check_alpha, check_pixels
from test_shading_passes import check_finish, check_memory
from test_shading_through import check_layers, check_masks

from mi_brdfs.integrators import shading
from mi_brdfs.mitsuba import integrator as adapter


def finish_each_pass(patch, integrator):
    def mutant(sums):
        def finished(self, scene, sensor, seed=0, spp=0):
            total = sums(self, scene, sensor, seed, spp)
            return mi.Vector4f(*self.physics.finish(mi.Color3f(total.xyz) / spp) * spp, total.w)

        return finished

    patch(integrator, "sums", mutant)


def finish_each_sample(patch, integrator):
    def mutant(look):
        def finished(self, *given):
            *colour, opacity = look(self, *given)
            return [*self.physics.finish(mi.Color3f(colour)), opacity]

        return finished

    patch(integrator, "_look", mutant)


def finish_nothing(patch, integrator):
    patch(shading.Shading, "finish", lambda _: lambda self, colour: colour)


def weigh_the_last_pass_like_the_others(patch, integrator):
    def mutant(sums):
        return lambda self, scene, sensor, seed, spp: sums(self, scene, sensor, seed, spp) * (4 / spp)

    patch(integrator, "sums", mutant)


def put_sums_as_means(patch, integrator):
    patch(integrator, "put", lambda put: lambda self, film, sums, count: put(self, film, sums, 1))


def draw_all_at_once(patch, integrator):
    def mutant(sums):
        def at_once(self, *given):
            lanes, adapter.LANES = adapter.LANES, 1 << 40
            try:
                return sums(self, *given)
            finally:
                adapter.LANES = lanes

        return at_once

    patch(integrator, "sums", mutant)


def look_through_corners(patch, integrator):
    def mutant(look):
        return lambda self, scene, sensor, sampler, corner: look(self, scene, sensor, sampler, corner - 0.5)

    patch(integrator, "_look", mutant)


def forget_the_border(patch, integrator):
    def mutant(pixels):
        def without(film):
            given, border = pixels(film), film.rfilter().border_size() if film.sample_border() else 0
            return given + border

        return without

    patch(adapter, "pixels", mutant)


def count_what_all_lanes_share_once(patch, integrator):
    patch(adapter, "added", lambda added: lambda value, count, size: added(value, count, size) / size)


def block_what_is_behind(patch, integrator):
    patch(shading, "may_pass", lambda _: lambda scene: False)


def shine_through_everything(patch, integrator):
    patch(shading, "straight_through", lambda _: lambda *given: mi.UnpolarizedSpectrum(1))


def add_layers_in_full(patch, integrator):
    def mutant(null_transmission):
        return lambda si, active: mi.UnpolarizedSpectrum(null_transmission(si, active) > 0)

    patch(shading, "null_transmission", mutant)


MUTANTS = {
    finish_each_pass: check_finish,
    finish_each_sample: check_finish,
    finish_nothing: check_finish,
    weigh_the_last_pass_like_the_others: check_finish,
    put_sums_as_means: check_finish,
    draw_all_at_once: check_memory,
    look_through_corners: check_pixels,
    forget_the_border: lambda: check_pixels("gaussian", border=True),
    count_what_all_lanes_share_once: check_alpha,
    block_what_is_behind: check_masks,
    shine_through_everything: check_masks,
    add_layers_in_full: check_layers,
}


@pytest.mark.usefixtures("llvm_rgb")
@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: mutant.__name__)
def test_a_check_notices(mutant, monkeypatch):
    """The check passes before the bug is planted, and fails after."""
    check = MUTANTS[mutant]
    given = [monkeypatch] if check in (check_finish, check_memory) else []
    check(*given)

    def patch(owner, name, change):
        monkeypatch.setattr(owner, name, change(getattr(owner, name)))

    mutant(patch, type(mi.load_dict({"type": "shading"})))
    with pytest.raises(AssertionError):
        check(*given)
