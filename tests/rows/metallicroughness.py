from functools import partial

import reference as ref
from catalogue import Row


def row(name, ρ, m, r, shadowing="direct", sharp=False, **given):
    return Row(
        f"metallicroughness {name}",
        {"type": "metallicroughness", "shadowing": shadowing, **given},
        partial(ref.metallicroughness, base_color=ρ, metallic=m, roughness=r, shadowing=shadowing),
        sharp=sharp,
    )


ROWS = [
    row("default", 0.5, 0, 0.5),
    row("metal", 0.9, 1, 0.4, base_color=0.9, metallic=1.0, roughness=0.4),
    row("rough metal", 0.9, 1, 1, base_color=0.9, metallic=1.0, roughness=1.0),
    row("half metal ibl", 0.7, 0.5, 0.6, "ibl", base_color=0.7, metallic=0.5, roughness=0.6),
    row("smith", 0.6, 0.2, 0.7, "smith", base_color=0.6, metallic=0.2, roughness=0.7),
    row("sharp ibl", 0.5, 0, 0.15, "ibl", sharp=True, roughness=0.15),
    row("black smith", 0, 0, 0.3, "smith", base_color=0.0, roughness=0.3),
    row("white", 1, 0, 0.8, base_color=1.0, roughness=0.8),
]

EXTREME = [
    row(f"{shadowing} roughness {r:g}", 0.7, 1, r, shadowing, base_color=0.7, metallic=1.0, roughness=r)
    for shadowing in ("direct", "ibl", "smith")
    for r in (0.01, 0.032, 1.0)
]

SMOOTH = {
    f"metallicroughness {shadowing}": {
        "type": "metallicroughness", "base_color": 0.6, "metallic": 0.6, "roughness": 0.45, "shadowing": shadowing,
    }
    for shadowing in ("direct", "ibl", "smith")
}  # fmt: skip
