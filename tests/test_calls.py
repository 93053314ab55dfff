"""What Mitsuba's own BSDFs take and return in calls from Python, ours do, too."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

WO = {
    "list": [0, 0.6, 0.8],
    "tuple": (0, 0.6, 0.8),
    "float32": np.float32([0, 0.6, 0.8]),
    "float64": np.array([0, 0.6, 0.8]),
}


@pytest.mark.parametrize("form", WO)
def test_directions_and_variates_in_any_form(form, variant):
    """The same results as of Mitsuba's types."""
    bsdf, ctx = mi.load_dict({"type": "phong"}), mi.BSDFContext()
    si = dr.zeros(mi.SurfaceInteraction3f)
    si.wi = mi.Vector3f(0, 0, 1)
    wo, u, v = WO[form], 0.4, type(WO[form])([0.2, 0.7]) if form in ("list", "tuple") else WO[form][1:]
    exact = mi.Vector3f(*map(float, wo)), mi.Float(u), mi.Point2f(*map(float, v))
    for given in ((wo, u, v), (wo, np.float32(u), v)):
        for name, arguments in [("eval", 1), ("pdf", 1), ("eval_pdf", 1), ("eval_pdf_sample", 3)]:
            method = getattr(bsdf, name)
            assert str(method(ctx, si, *given[:arguments])) == str(method(ctx, si, *exact[:arguments])), name
        assert str(bsdf.sample(ctx, si, *given[1:])) == str(bsdf.sample(ctx, si, *exact[1:]))


def test_an_unknown_attribute(variant):
    """Zero, or in scalar variants an error, as of ``diffuse``; and has_attribute says that there is none."""
    si = dr.zeros(mi.SurfaceInteraction3f)
    ours, theirs = (mi.load_dict({"type": name}) for name in ("ward", "diffuse"))
    for method in ("eval_attribute", "eval_attribute_1", "eval_attribute_3"):
        results = []
        for bsdf in (ours, theirs):
            try:
                results.append(str(getattr(bsdf, method)("nothing", si)))
            except RuntimeError as error:
                assert "Invalid attribute requested nothing" in str(error)
                results.append("error")
        assert results[0] == results[1]
    assert not dr.any(ours.has_attribute("nothing"))
