import reference as ref
from catalogue import Row


def row(name, C, r, p=1, below=None, variant="shadowed", turns=0.0, sharp=False, **given):
    def reference(wi, wo):
        return ref.schlick(ref.rotate(wi, turns), ref.rotate(wo, turns), C, below, r, p, variant)

    return Row(f"schlick {name}", {"type": "schlick", "variant": variant, **given}, reference, sharp=sharp)


def metal(name, r, p=1, variant="shadowed", **given):
    return row(name, 0.7, r, p, None, variant, specular_reflectance=0.7, roughness=r, isotropy=p, **given)


def layers(name, r, p=1, variant="shadowed", **given):
    below = {"diffuse_reflectance": 0.4}
    return row(name, 0.1, r, p, 0.4, variant, specular_reflectance=0.1, roughness=r, isotropy=p, **below, **given)


ROWS = [
    row("default", 0.04, 0.05),
    metal("rough", 0.4),
    metal("roughest", 1.0),
    metal("sharp", 4e-4, sharp=True),
    metal("anisotropic", 0.1, 0.3),
    # Near the normal the azimuth of h, which A depends on, has few digits once both directions are turned.
    row("turned", 0.7, 0.3, 0.7, turns=0.15, specular_reflectance=0.7, roughness=0.3, isotropy=0.7, rotation=0.15),
    layers("layers", 0.1, 0.5),
    layers("layers interreflection", 0.3, 0.5, "interreflection"),
    metal("interreflection", 0.4, variant="interreflection"),
    metal("interreflection roughest", 1.0, variant="interreflection"),
    metal("plain", 0.1, 0.5, variant="plain"),
    layers("layers plain rough", 0.6, variant="plain"),
    row("black layers", 0, 0.2, 1, 0, specular_reflectance=0.0, roughness=0.2, diffuse_reflectance=0.0),
]

EXTREME = [
    layers(f"{variant} roughness {r:g}", r, p, variant)
    for variant in ("shadowed", "interreflection", "plain")
    for r, p in ((1e-6, 1.0), (1e-6, 0.01), (1.0, 0.01))
]

SMOOTH = {
    f"schlick {variant}": {
        "type": "schlick", "specular_reflectance": 0.3, "diffuse_reflectance": 0.4, "roughness": 0.2, "isotropy": 0.4,
        "rotation": 0.1, "variant": variant,
    }
    for variant in ("shadowed", "interreflection", "plain")
}  # fmt: skip
