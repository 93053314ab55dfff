"""Registration: in any order, in every variant, beside whatever is there."""

import os
import re
from pathlib import Path

import mitsuba as mi
import pytest
from rich.cells import cell_len
from support import python

import mi_brdfs
from mi_brdfs.mitsuba.registry import own_models

CHECK = "; print(type(mi.load_dict({'type': 'ward'})).__name__, mi.variant())"


def test_an_import_before_the_variant():
    """Also an import once more, and variants back and forth."""
    first = "import mi_brdfs, mitsuba as mi; assert mi.variant() is None; mi.set_variant('scalar_rgb')"
    again = "; import mi_brdfs; [mi.set_variant(v) for v in ('scalar_spectral_polarized', 'scalar_spectral') * 2]"
    done = python(first + CHECK + again + CHECK)
    assert done.stdout == "Ward scalar_rgb\nWard scalar_spectral\n", done.stderr


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="no way to leave a process one processor here")
def test_one_processor_reads_and_writes_bitmaps(tmp_path):
    """There, Mitsuba alone waits for ever."""
    alone = "import os; os.sched_setaffinity(0, {min(os.sched_getaffinity(0))}); import mi_brdfs, mitsuba as mi"
    path = str(tmp_path / "grey.exr")
    there = f"; mi.set_variant('scalar_rgb'); mi.Bitmap(mi.TensorXf([0.5] * 72, (4, 6, 3))).write({path!r})"
    done = python(f"{alone}{there}; print(mi.Bitmap({path!r}).size())")
    assert done.stdout == "[6, 4]\n", done.stderr


def test_no_builtin_is_shadowed():
    """Mitsuba's plugins are shared libraries, and those that its Python package registers."""
    package = Path(mi.__file__).parent
    builtin = {path.stem for path in (package / "plugins").iterdir()}
    for source in (package / "python").rglob("*.py"):
        builtin |= set(re.findall(r"register_\w+\(\s*['\"](\w+)", source.read_text(encoding="utf-8")))
    assert {"diffuse", "roughconductor", "prb"} <= builtin
    assert not builtin & set(mi_brdfs.list_models())


def test_list_and_info():
    assert {"lambert", "phong", "ward", "walter"} <= set(mi_brdfs.list_models())
    assert "shading" not in mi_brdfs.list_models()
    page = mi_brdfs.info("ward")
    assert not any("``" in mi_brdfs.info(name) or ":func:" in mi_brdfs.info(name) for name in mi_brdfs.list_models())
    for part in ("doi:10.1145/133994.134078", "alpha_u, alpha_v", "balanced | ward | ward-duer", "Reciprocal"):
        assert part in page
    assert "alpha: type number, default 0.1, range [0.0001, 2]\n    roughness α" in page
    with pytest.raises(ValueError, match="There is no model 'phnog'; did you mean 'phong'"):
        mi_brdfs.info("phnog")


@pytest.mark.parametrize("name", [*(name for model in own_models() for name in model.plugins), "shading"])
def test_examples_on_the_manual_pages_load(name):
    page = mi_brdfs.info(name)
    xml = re.search(r"<(bsdf|integrator) .*?</\1>", page, re.S).group().replace(">", ' version="3.0.0">', 1)
    given = re.search(r'^\{"type".*?\}$', page, re.S | re.M).group()
    assert all(cell_len(line) <= 100 for line in page.splitlines())
    with mi.variant_context("scalar_rgb"):
        assert str(mi.load_string(xml)) == str(mi.load_dict(eval(given)))


@pytest.mark.parametrize("brought", [mi_brdfs.Model, int, None])
def test_only_subclasses_are_registered(brought):
    known = mi_brdfs.list_models()
    with pytest.raises(TypeError, match=r"register takes a subclass of mi_brdfs\.Model, or of a term"):
        mi_brdfs.register(brought)
    assert mi_brdfs.list_models() == known
