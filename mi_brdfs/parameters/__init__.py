"""Parameters: declared once per model, and from that parsed, checked, exposed and documented.

A model lists its parameters as class attributes:

    class Ward(Model):
        diffuse_reflectance = Reflectance(0.5, "albedo of the diffuse lobe")
        alpha               = Number(0.1, (1e-4, 1), "roughness", anisotropic=True)
        variant             = Choice(("balanced", "ward"), "normalization of the lobe")

A declaration knows the property names that it may be given as, reads and checks them, and describes itself for the
manual page. Bound to the properties of a plugin instance, a copy of it holds their textures and evaluates them.

Every number and colour becomes a Mitsuba texture, whatever it was given as: then a new value does not compile a new
kernel, can be optimised, and can vary over the surface. Literal values are checked against the declared range here;
textured and optimised ones are limited to it where they are evaluated.
"""

from .colours import Colour, Reflectance
from .fresnel import ConductorName, FresnelSet
from .groups import OneOf, OneTerm, PerLobe
from .parameter import Parameter, ParameterRow, Quantity, nested
from .published import Preset
from .reader import ParameterError, PropertyReader, Range
from .scalars import Choice, File, Flag, Index, Number, Rotation, Spelling

__all__ = [
    "Choice",
    "Colour",
    "ConductorName",
    "File",
    "Flag",
    "FresnelSet",
    "Index",
    "Number",
    "OneOf",
    "OneTerm",
    "Parameter",
    "ParameterError",
    "ParameterRow",
    "PerLobe",
    "Preset",
    "PropertyReader",
    "Quantity",
    "Range",
    "Reflectance",
    "Rotation",
    "Spelling",
    "nested",
]
