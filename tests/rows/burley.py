import reference as ref
from catalogue import Row

PLAIN = {
    "subsurface": 0.0, "metallic": 0.0, "specular": 0.5, "spec_tint": 0.0, "roughness": 0.5, "anisotropic": 0.0,
    "sheen": 0.0, "sheen_tint": 0.5, "clearcoat": 0.0, "clearcoat_gloss": 1.0,
}  # fmt: skip


def row(name, colour=(0.5, 0.5, 0.5), turns=0.0, sharp=False, **given):
    """The reference of the first channel, which is the one that tests compare."""
    parameters = PLAIN | {key: value for key, value in given.items() if key != "rotation"}

    def reference(wi, wo):
        return ref.burley(ref.rotate(wi, turns), ref.rotate(wo, turns), base_color=colour, **parameters)[:, 0]

    if len(set(colour)) > 1:
        given["base_color"] = {"type": "rgb", "value": list(colour)}
    elif colour[0] != 0.5:
        given["base_color"] = colour[0]
    return Row(f"burley {name}", {"type": "burley", **given}, reference, sharp=sharp)


ORANGE, TEAL = (0.8, 0.4, 0.1), (0.1, 0.5, 0.6)
COATED = {"clearcoat": 1.0, "clearcoat_gloss": 0.0}

ROWS = [
    row("default", sharp=True),
    row("subsurface", ORANGE, subsurface=0.7, roughness=0.8, clearcoat_gloss=0.3),
    row("tinted", TEAL, specular=0.9, spec_tint=0.8, roughness=0.4, sheen=1.0, sheen_tint=0.7, clearcoat_gloss=0.2),
    row("metal", ORANGE, metallic=1.0, roughness=0.4, clearcoat_gloss=0.0),
    row("anisotropic metal turned", ORANGE, turns=0.2, metallic=0.8, roughness=0.5, anisotropic=0.9, rotation=0.2,
        clearcoat_gloss=0.0),
    row("sharp", metallic=0.5, roughness=0.2, clearcoat_gloss=0.5, sharp=True),
    row("smooth base", (0.8, 0.8, 0.8), roughness=0.15, specular=0.0, sharp=True),
    row("rough base", (0.8, 0.8, 0.8), roughness=1.0, subsurface=0.3, sheen=0.4, **COATED),
    row("black", (0.0, 0.0, 0.0), specular=1.0, spec_tint=1.0, sheen=0.5, **COATED),
    row("everything", ORANGE, turns=-0.1, subsurface=0.4, metallic=0.4, specular=0.7, spec_tint=0.6, roughness=0.45,
        anisotropic=0.6, sheen=0.8, sheen_tint=0.3, clearcoat=0.9, clearcoat_gloss=0.4, rotation=-0.1),
]  # fmt: skip

EXTREME = [
    row("smoothest", ORANGE, metallic=0.5, roughness=0.0, clearcoat=1.0),
    row("smoothest stretched", ORANGE, roughness=0.05, anisotropic=1.0, sheen=1.0, subsurface=1.0),
    row("stretched", metallic=0.6, roughness=1.0, anisotropic=1.0, **COATED),
    row("blue", (0.001, 0.0, 1.0), spec_tint=1.0, specular=1.0, sheen=1.0, sheen_tint=1.0, roughness=0.3),
]

# Dark beside the sheen, which would not show otherwise.
SMOOTH = {
    "burley": {
        "type": "burley", "base_color": {"type": "rgb", "value": [0.06, 0.03, 0.01]}, "subsurface": 0.5,
        "metallic": 0.3, "specular": 0.3, "spec_tint": 0.5, "roughness": 0.5, "anisotropic": 0.8, "sheen": 0.8,
        "sheen_tint": 0.5, "clearcoat": 0.5, "clearcoat_gloss": 0.3, "rotation": 0.1,
    },
}  # fmt: skip
