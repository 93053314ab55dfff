"""The contract of a plugin, with its declared parameters, and of a model, with its lobes."""

from __future__ import annotations

import ast
import inspect
import json
import re
import warnings
from collections.abc import Mapping, Sequence
from functools import cache
from math import inf, isfinite
from types import SimpleNamespace
from typing import Any, ClassVar, NamedTuple

import mitsuba as mi

from .lobes import Lobe
from .lobes.uniform import Uniform
from .parameters import Parameter, ParameterRow, PropertyReader, Rotation
from .parameters.messages import interval
from .parameters.parameter import BoundParameters, nested
from .parameters.xml import to_xml

ENERGY_NOTE = """\
At angles up to 89.9°. In white, every colour and the Fresnel reflectance are 1, except that a diffuse lobe beside
others is 0; parameters not named take all values in their range."""

EXAMPLE = "Example\n-------\n"
"""The heading of the plugin dict at the end of a docstring."""

FAMILIES = "diffuse", "microfacets", "cosine lobes", "production", "fits to measurements", "cartoon"
"""The families of models, in the order in which they are shown."""

MEMBERS = "parameters", "textures", "ranges", "constants", "arrays", "captured", "uniform", "type", "id"
"""What an instance of a plugin holds, besides its choices, and what its dict does."""

Section = tuple[str, Sequence[tuple[str, ...]], str]

Values = SimpleNamespace
"""The values of the declared parameters at a surface point, by name."""


class Energy(NamedTuple):
    """The largest directional albedos of a model, at angles up to 89.9°, rounded up to three digits, as
    ``mi-brdfs energy`` measures them. Float32 rounding may exceed them by 1e-4, and by 2 % at 89.9° where narrow lobes
    have steep flanks (``epd`` with α < 0.003)."""

    default: float
    """With the default parameters."""
    largest: list[tuple[dict[str, Any], float]]
    """In white, for some choices by name (a tuple stands for each of its words), the maximum over all values of the
    other parameters: at most 1 if the model conserves energy, infinite beyond about 100. White means that every colour
    and the Fresnel reflectance are 1, except that a diffuse lobe beside others is black
    (``diffuse_reflectance``)."""

    @classmethod
    def of_json(cls, stated: Mapping[str, Any]) -> Energy:
        """Return the albedos as :meth:`to_json` writes them, with lists for tuples and None for infinity."""
        rows = [
            ({name: tuple(it) if isinstance(it, list) else it for name, it in given.items()}, inf if a is None else a)
            for given, a in stated["largest"]
        ]
        return cls(stated["default"], rows)

    def to_json(self) -> str:
        """Return the albedos as JSON, a line for each configuration."""
        rows = [json.dumps([given, None if albedo == inf else albedo]) for given, albedo in self.largest]
        return f'{{"default": {self.default}, "largest": [\n    ' + ",\n    ".join(rows) + "\n  ]}"

    def rows(self) -> list[tuple[str, str, str]]:
        """Return ``(configuration, largest albedo, class)`` for the manual page."""
        rows = [("configuration", "albedo", "energy"), ("defaults", f"{self.default:.2f}", "")]
        for given, albedo in self.largest:
            words = [f"{name}={' | '.join(v) if isinstance(v, tuple) else v}" for name, v in given.items()]
            value = f"{albedo:.4g}" if isfinite(albedo) else "no limit"
            rows.append((", ".join(["white", *words]), value, "conserved" if albedo <= 1 else "gained"))
        return rows


class EnergyWarning(UserWarning):
    """The colours given to a model add to more than 1, up to which it conserves energy."""


@cache
def warn_once(text: str) -> None:
    """Issue an :class:`EnergyWarning`, the first time that it is this one."""
    warnings.warn(text, EnergyWarning, stacklevel=3)


def full_name(cls: type) -> str:
    """Return the dotted name of a class: the same for all versions of it, as of a cell of a notebook run again."""
    return f"{cls.__module__}.{cls.__qualname__}"


class Plugin:
    """A plugin defined by declarations: a subclass's docstring is its manual page, and its class attributes declare the
    parameters (:mod:`mi_brdfs.parameters`).

    An instance belongs to one plugin instance. It holds the bound ``parameters`` by declared name, and all their
    ``textures`` and ``ranges`` by property name, with the channels of the colours that it was given or has by default
    as ``constants``; choices are attributes under their declared names. ``arrays`` are what else ``mitsuba.traverse``
    shows, with derivatives, ``captured`` what else kernels read, and ``uniform`` keeps what lobes compute of parameters
    alone.
    """

    plugins: ClassVar[tuple[str, ...]] = ()
    """The plugin's name in scenes, and its aliases; by default the class name in lower case."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        every = [it for base in cls.__mro__ for it in vars(base).values() if isinstance(it, Parameter)]
        for name in (name for parameter in every for name in (parameter.name, *parameter.names)):
            if hasattr(Model, name) or name in MEMBERS:
                raise TypeError(f"{cls.__name__}: a parameter cannot be called {name}, an attribute of every model.")
        plugins = cls.__dict__.get("plugins", (cls.__name__.lower(),))
        if isinstance(plugins, str):
            raise TypeError(f'{cls.__name__}: plugins is a tuple of names; write plugins = ("{plugins}",).')
        cls.plugins = tuple(plugins)

        declared = cls.declared()
        for it in (it for parameter in nested(declared) for way in parameter.spellings for it in way):
            if it.default is not None and not it.limits[0] <= it.default <= it.limits[1]:
                raise TypeError(
                    f"{cls.__name__}: {it.name} is {it.default} by default, not within {interval(*it.limits)}."
                )
        turns = [parameter.name for parameter in declared if isinstance(parameter, Rotation)]
        if len(turns) > 1:
            raise TypeError(f"{cls.__name__}: {' and '.join(turns)} each turn the frame; declare one Rotation().")

    def __init__(self, props: mi.Properties):
        reader = PropertyReader(self.plugins[0], props)
        declared = self.declared()
        for parameter in declared:
            parameter.fill_in(reader, declared)
        reader.take([n for p in declared for n in p.names], [n for p in declared for n in p.shown])
        self.parameters = BoundParameters(declared, reader)
        self.textures, self.ranges = self.parameters.textures, self.parameters.ranges
        self.constants = reader.constants
        self.arrays: dict[str, Any] = {}
        self.captured: list[Any] = []
        self.uniform = Uniform()
        vars(self).update(self.parameters.chosen)

    @classmethod
    def declared(cls) -> list[Parameter]:
        """Return the declared parameters, in the order of declaration."""
        members = {name: value for base in reversed(cls.__mro__) for name, value in vars(base).items()}
        return [value for value in members.values() if isinstance(value, Parameter)]

    def evaluate(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> Values:
        """Return the values of the parameters at a surface interaction."""
        return Values(**self.parameters.evaluate(si, active))

    def described(self) -> str:
        """Return the class and the parameters, in the style of Mitsuba's plugins."""
        lines = [f"  {name} = {value}" for name, value in (self.parameters.chosen | self.textures).items()]
        return type(self).__name__ + "[\n" + ",\n".join(line.replace("\n", "\n  ") for line in lines) + "\n]"

    @classmethod
    def summary(cls) -> str:
        """Return the first line of the manual page."""
        return inspect.cleandoc(cls.__doc__ or "").splitlines()[0]

    @classmethod
    def example(cls) -> dict[str, Any]:
        """Return the plugin dict at the end of the docstring, or else the defaults."""
        last = inspect.cleandoc(cls.__doc__ or "").rpartition("\n\n")[2].removeprefix(EXAMPLE)
        return ast.literal_eval(last) if re.match(r"""\{\s*["']""", last) else {"type": cls.plugins[0]}

    @classmethod
    def page(cls) -> str:
        """Return the docstring, with the plugin dict of its section "Example" in XML, too."""
        text, heading, last = inspect.cleandoc(cls.__doc__ or "").rpartition(EXAMPLE)
        return text + heading + (f"{to_xml(cls.example())}\n\n" if heading and last.startswith("{") else "") + last

    @classmethod
    def parameter_rows(cls) -> list[ParameterRow]:
        """Return the table of parameters, with its heading."""
        rows = [row for parameter in cls.declared() for row in parameter.rows()]
        return [ParameterRow("parameter", "type", "default", "range", "meaning"), *rows]

    @classmethod
    def sections(cls) -> list[Section]:
        """Return the tables of the manual page: the title, rows below a heading, and what is said of them."""
        return [("Parameters", cls.parameter_rows(), "" if cls.declared() else "None.")]


class Model(Plugin):
    """A BRDF model. A subclass is its paper in code: its docstring cites and gives the formula, its class attributes
    declare the parameters, and :meth:`lobes` says what they mean."""

    family: ClassVar[str] = ""
    """With which models it is shown: one of ``FAMILIES`` or another word; those without one come last."""
    energy: ClassVar[Energy | None] = None
    """The largest albedos; None if they were not measured. Those of the pack's models are in ``models/energy.json``."""
    data = False
    """Whether its values are measured data, which may jump."""
    signed = False
    """Whether channels may be negative, of colours outside sRGB, as the page must then say."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        cls.energy = cls.__dict__.get("energy")  # a subclass has other lobes

    def lobes(self, p: Values) -> tuple[Lobe, ...]:
        """Return the model's lobes at a surface point, where ``p`` holds the values of the declared parameters. Their
        number and kinds depend only on the model's choices and on which parameters are given."""
        raise NotImplementedError(f"{type(self).__name__} does not define lobes.")

    def stated_albedo(self) -> float | None:
        """Return the largest albedo that the page states for the choices of this instance, or None if it states none.
        Configurations that fix numbers do not count."""
        stated = self.energy.largest if self.energy else []
        return min((albedo for given, albedo in stated if self._includes(given)), default=None)

    def _includes(self, given: Mapping[str, Any]) -> bool:
        """Return whether a configuration on the page is about the choices of this instance."""
        chosen = self.parameters.chosen
        return all(
            chosen.get(name) in (value if isinstance(value, tuple) else (value,)) for name, value in given.items()
        ) and not any(isinstance(value, float) for value in given.values())

    @property
    def has_fresnel(self) -> bool:
        """Whether a Fresnel term scales the specular reflectance."""
        return "fresnel" in self.parameters.chosen or bool(self.named("fresnel"))

    def named(self, *roles: str) -> list[str]:
        """Return the names of the textures whose parameters have one of some roles."""
        return [name for name, role in self.parameters.roles.items() if role in roles]

    def excess(self, colours: Mapping[str, Sequence[float]]) -> str:
        """Return what is wrong with constant colours, by property name, that add to more than 1 in a channel, or
        nothing. Diffuse and specular ones count where the page states that energy is conserved for this instance's
        choices, but not that it is with both at 1 (``{"diffuse_reflectance": 1.0}``). Beside a Fresnel term, the latter
        is only a scale of that, and does not count."""
        stated = self.stated_albedo()
        if not self.energy or not stated or stated > 1 or ({"diffuse_reflectance": 1.0}, 1) in self.energy.largest:
            return ""
        if self.has_fresnel:
            return ""
        added = {name: colours[name] for name in self.named("diffuse", "specular") if name in colours}
        channels = max(map(len, added.values()), default=1)
        sums = [sum(c[k % len(c)] for c in added.values()) for k in range(channels)]
        if not max(sums) > 1 + 1e-3:
            return ""
        where = f" in channel {sums.index(max(sums)) + 1}" if max(sums) - min(sums) > 1e-3 else ""
        return f"{' + '.join(added)} = {max(sums):.4g}{where}, but energy is conserved only up to 1"

    def placeholders(self) -> Values:
        """Return stand-ins for these values, to find out which lobes the model has."""
        return Values(**self.parameters.placeholders())

    @classmethod
    def sections(cls) -> list[Section]:
        """Return them with that of the largest albedos."""
        rows = cls.energy.rows() if cls.energy else []
        note = ENERGY_NOTE if cls.energy else f"Not measured. ``mi-brdfs energy {cls.plugins[0]}`` does it."
        return [*super().sections(), ("Largest albedo", rows, note)]
