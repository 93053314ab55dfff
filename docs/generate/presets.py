"""Make the data file of presets from a folder of published fits: ``python docs/generate/presets.py FOLDER``.

The folder has the ``.fit`` files of the BBM project (github.com/bsdfbenchmark), one material a line. Their numbers are
those that the papers publish with their supplements; what they mean in terms of our plugins is said here, once a set.
"""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

FILE = Path(__file__).parents[2] / "mi_brdfs" / "parameters" / "published.json"
DIGITS = 7

Fit = dict[str, Any]
"""The numbers of a material by their names in a file, with ``diffuse``, the albedo of the diffuse lobe."""

MERL_SCALE = [1, 1.15, 1.66]
"""What the channels of the MERL materials are scaled by, which the colours fitted by Ngan et al. lack."""

NGAN = {
    "source": "A. Ngan, F. Durand and W. Matusik, Experimental analysis of BRDF models, Eurographics Symposium on "
    "Rendering 2005",
    "doi": "10.2312/EGWR/EGSR05/117-126",
    "scale": MERL_SCALE,
}
LOW = {
    "source": "J. Löw, J. Kronander, A. Ynnerman and J. Unger, BRDF models for accurate and efficient rendering of "
    "glossy surfaces, ACM Transactions on Graphics 31(1), 2012, with its supplement",
    "doi": "10.1145/2077341.2077350",
}
DARK_MIRRORS = "Mirror-like materials are darker than the real ones, as they are in the measurements."
UNSCALED = "The published colours lack the scale of the MERL data; here they are multiplied by 1, 1.15 and 1.66."
MERL = "Fitted to the MERL measurements of real materials."
METRICS = {
    "e1": "Fitted by the metric E1, the squared difference of f times the cosine.",
    "e2": "Fitted by the metric E2, the squared difference of its logarithm, ln(1 + f cos): better for dim parts.",
}


class Set(NamedTuple):
    """The fits of a model."""

    file: str
    plugin: dict[str, Any]
    """Our plugin, with the parameters that all materials share."""
    parameters: Callable[[Fit], dict[str, Any]]
    """The others."""
    paper: dict[str, Any]
    convention: str
    defects: tuple[str, ...] = ()


def _rough(fit: Fit) -> dict[str, Any]:
    return {"specular_reflectance": fit["albedo"], "alpha": fit["roughness"]}


def _blinn_phong(fit: Fit) -> dict[str, Any]:
    return {"specular_reflectance": fit["albedo"], "exponent": fit["sharpness"]}


def _kit(fit: Fit) -> dict[str, Any]:
    """Return the lobe of Ashikhmin and Shirley, whose D has the factor n + 1, as the kit's, which has n + 2."""
    n = fit["sharpness"]
    return {"specular_reflectance": [c * (n + 1) / (n + 2) for c in fit["albedo"]], "exponent": n}


def _low(fit: Fit) -> dict[str, Any]:
    return {"a": fit["A"], "b": fit["B"], "c": fit["C"], "int_ior": fit["eta"]}


KIT = {"type": "microfacet", "distribution": "blinn", "shadowing": "ashikhmin-shirley"}
KIT_NOTE = (
    "with D = (n+1)/(2π) cosθ_h^n, G = cosθ_i cosθ_o/((wi·h) max(cosθ_i, cosθ_o)) and a Lambertian diffuse lobe; the "
    "plugin ashikhminshirley has no scale ρs and couples its diffuse lobe. The kit normalises D with n+2: its "
    "specular_reflectance is (n+1)/(n+2) times ρs."
)


def _sets() -> dict[str, Set]:
    sets = {
        "ngan/ward": Set(
            "ngan_ward", {"type": "ward", "variant": "ward"}, _rough, NGAN,
            "f = ρd/π + ρs exp(-tan²θ_h/α²)/(4π α² √(cosθ_i cosθ_o))",
        ),
        "ngan/ward-duer": Set(
            "ngan_wardduer", {"type": "ward", "variant": "ward-duer"}, _rough, NGAN,
            "f = ρd/π + ρs exp(-tan²θ_h/α²)/(4π α² cosθ_i cosθ_o)",
            ("Rough ones gain energy at grazing angles: at 89.9° the albedo of 27 materials is above 1, up to 5.8.",),
        ),
        "ngan/blinn-phong": Set(
            "ngan_blinnphong", {"type": "blinnphong", "normalization": "ndf"}, _blinn_phong, NGAN,
            "f = ρd/π + ρs (n+2)/(2π) cosθ_h^n",
            ("The BBM project evaluates these exponents about the mirror direction; that they belong to the half "
             "vector is seen from those of Ashikhmin and Shirley for the same materials, which are alike.",),
        ),
        "ngan/cook-torrance": Set(
            "ngan_cooktorrance", {"type": "cooktorrance"},
            lambda fit: _rough(fit) | {"f0": fit["eta"]}, NGAN,
            "f = ρd/π + ρs F D G/(4 cosθ_i cosθ_o), with Beckmann's D, normalised, the V-cavity G and Schlick's F of "
            "normal reflectance f0",
            ("Sources differ in the constant: 1/π in the BBM project, with the same D, and 1/4 here. With 1/4 these "
             "fits reflect as much as those of Ashikhmin and Shirley to the same materials, whose lobes are the same "
             "in the mirror direction (the median ratio is 1.00), and with 1/π 4/π times as much.",),
        ),
        "ngan/ashikhmin-shirley": Set(
            "ngan_ashikhminshirley", KIT, lambda fit: _kit(fit) | {"f0": fit["fresnelReflectance"]}, NGAN,
            "f = ρd/π + ρs F D G/(4 cosθ_i cosθ_o), with Schlick's F of normal reflectance f0, " + KIT_NOTE,
        ),
    }  # fmt: skip
    for metric, words in METRICS.items():
        sets[f"low/cook-torrance-{metric}"] = Set(
            f"low_cooktorrance_{metric.upper()}", {"type": "cooktorrance", "normalization": "tog82", "ext_ior": 1.0},
            lambda fit: _rough(fit) | {"int_ior": fit["eta"]}, LOW,
            "f = ρd/π + ρs F G exp(-tan²θ_h/α²)/(π α² cos⁴θ_h cosθ_i cosθ_o), as printed in 1982, with the V-cavity G "
            "and the exact F of a dielectric of index int_ior",
            (words, *(("white-paint is an outlier, whose albedo reaches 1.3 at 89.9°.",) if metric == "e1" else ())),
        )  # fmt: skip
        sets[f"low/ashikhmin-shirley-{metric}"] = Set(
            f"low_ashikhminshirley_{metric.upper()}", {**KIT, "ext_ior": 1.0},
            lambda fit: _kit(fit) | {"int_ior": fit["fresnelReflectance"]}, LOW,
            "f = ρd/π + ρs F D G/(4 cosθ_i cosθ_o), with the exact F of a dielectric of index int_ior, " + KIT_NOTE,
            (words,),
        )  # fmt: skip
    sets["low/microfacet"] = Set(
        "low_lowmicrofacet_E2", {"type": "low", "variant": "microfacet", "normalization": "fit"}, _low, LOW,
        "f = ρd/π + A F G/(π cosθ_i cosθ_o (1 + B (1 - cosθ_h))^C), with the V-cavity G and the exact F of a "
        "dielectric of index int_ior",
        ("Equation 15 of the paper lacks the factor 1/π, which the fits need.", METRICS["e2"]),
    )  # fmt: skip
    sets["low/smooth"] = Set(
        "low_lowsmooth_E2", {"type": "low", "variant": "smooth"}, _low, LOW,
        "f = ρd/π + A F(cosθ_d)/(1 + B |wi_xy + wo_xy|²)^C, cosθ_d = √(1 - ¼|wi_xy - wo_xy|²), with the exact F of a "
        "dielectric of index int_ior",
        (METRICS["e2"],),
    )  # fmt: skip
    return sets


LEFT_OUT = {
    "ngan/lafortune": "its directions are published with three digits and raised to powers of up to 10 000: rounding "
    "moves and scales the lobes beyond use",
    "ngan/he": "there is no plugin of the model of He et al.",
    "bagher/sgd": "there is no plugin of the shifted gamma distribution",
}
UNFIT: dict[str, tuple[float, str]] = {
    "specular_reflectance": (1, "the scale of its specular lobe is {:.4g}, above 1"),
    "alpha": (2, "its roughness is {:.4g}, above 2"),
}
"""The parameters that some fits have beyond the range of the plugin."""


def read(file: Path) -> dict[str, Fit]:
    """Return the materials of a .fit file: ``name = Aggregate(Lambertian(albedo = […]), Model(name = number, …))``."""
    fits = {}
    for line in file.read_text(encoding="utf-8").splitlines():
        if not line.strip() or line.startswith("#"):
            continue
        name, _, call = line.partition(" = ")
        diffuse, *others = re.findall(r"(\w+) = (\[[^\]]*\]|[^,)]+)", call)
        fits[name] = {"diffuse": ast.literal_eval(diffuse[1])} | {k: ast.literal_eval(v) for k, v in others}
    return fits


def rounded(value: Any, scale: list[float]) -> Any:
    """Return a number, or a colour times a scale, in seven significant digits."""
    if isinstance(value, list):
        return [rounded(channel * factor, []) for channel, factor in zip(value, scale, strict=True)]
    return float(f"{value:.{DIGITS}g}")


def data_of(chosen: Set, folder: Path) -> dict[str, Any]:
    """Return what the data file has of a set."""
    scale = chosen.paper.get("scale", [1, 1, 1])
    materials, left_out = {}, {}
    for name, fit in read(folder / f"{chosen.file}.fit").items():
        values = {"diffuse_reflectance": fit["diffuse"]} | chosen.parameters(fit)
        values = {parameter: rounded(value, scale) for parameter, value in values.items()}
        reasons = [
            words.format(largest)
            for parameter, (limit, words) in UNFIT.items()
            if (largest := max([0, *_numbers(values.get(parameter))])) > limit
        ]
        if reasons:
            left_out[name] = reasons[0]
        else:
            materials[name] = values
    defects = [MERL, *([UNSCALED] if "scale" in chosen.paper else []), DARK_MIRRORS, *chosen.defects]
    columns = list(next(iter(materials.values())))
    return {
        "plugin": chosen.plugin, **chosen.paper, "convention": chosen.convention, "defects": defects,
        "left_out": left_out, "parameters": columns,
        "materials": {name: list(values.values()) for name, values in sorted(materials.items())},
    }  # fmt: skip


def _numbers(value: Any) -> list[float]:
    return value if isinstance(value, list) else [] if value is None else [value]


def text_of(folder: Path) -> str:
    """Return the text of the data file: JSON with a line for each material, and for what a set says of itself."""
    sets = {name: _object(data_of(chosen, folder)) for name, chosen in _sets().items()}
    return f"{_lines({'sets': _lines(sets), 'left_out': _object(LEFT_OUT)})}\n"


def _object(data: dict[str, Any]) -> str:
    """Return an object with a member a line, those of ``materials``, too."""
    lines = {
        name: _object(value) if name == "materials" else json.dumps(value, ensure_ascii=False)
        for name, value in data.items()
    }
    return _lines(lines)


def _lines(members: dict[str, str]) -> str:
    return "{\n" + ",\n".join(f'"{name}": {text}' for name, text in members.items()) + "\n}"


def main(
    folder: Annotated[Path, typer.Argument(help="The folder of the .fit files.", exists=True, file_okay=False)],
) -> None:
    """Make mi_brdfs/parameters/published.json."""
    FILE.write_text(text_of(folder), encoding="utf-8")


if __name__ == "__main__":
    typer.run(main)
