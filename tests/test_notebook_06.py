"""What the notebook on Mitsuba 0.6 says of names, refusals and replacements is so."""

import ast
import re

import mitsuba as mi
import numpy as np
import pytest
from support import call, context, hemisphere

from notebooks import FOLDER, read_notebook

NOTEBOOK = FOLDER / "coming_from_mitsuba_06.ipynb"


TEXTS = ["".join(cell["source"]) for cell in read_notebook(NOTEBOOK)["cells"]]


def what_is_what():
    """The rows of the table: plugin, name in 0.6, name here, default."""
    rows = re.findall(r"^\| `(\w+)` \| `(\w+)` \| `(\w+)` \| (\S+) \|", "\n".join(TEXTS), re.MULTILINE)
    return [(plugin, old, new, parsed(default)) for plugin, old, new, default in rows]


def parsed(word):
    try:
        return ast.literal_eval(word.capitalize())
    except ValueError:
        return word


def values(bsdf):
    wi, wo = hemisphere(64, seed=1), hemisphere(64, seed=2)
    return call(mi.load_dict(bsdf).eval if isinstance(bsdf, dict) else bsdf.eval, context(), wi, wo)[0]


def in_06(text):
    return mi.load_string(f'<scene version="0.6.0">{text}</scene>')


@pytest.mark.usefixtures("llvm_rgb")
def test_parameters_of_06():
    """The old name does what the new one does, which is something, and the default is as the table says."""
    assert len(what_is_what()) == 12
    for plugin, old, new, default in what_is_what():
        if isinstance(default, bool):
            tag, other = "boolean", not default
        elif isinstance(default, str):
            tag, other = "string", "ward-duer"
        else:
            tag, other = "float", 1.5 * default
        text = f'<{tag} name="{old}" value="{str(other).lower()}"/>'
        bsdf = in_06(f'<shape type="sphere"><bsdf type="{plugin}">{text}</bsdf></shape>').shapes()[0].bsdf()
        np.testing.assert_array_equal(values(bsdf), values({"type": plugin, new: other}), err_msg=old)
        np.testing.assert_array_equal(values({"type": plugin}), values({"type": plugin, new: default}), err_msg=old)
        assert not np.allclose(values(bsdf), values({"type": plugin}), rtol=1e-3), old
