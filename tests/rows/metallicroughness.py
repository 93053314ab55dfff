import reference as ref
from catalogue import rows_of

row = rows_of("metallicroughness", ref.metallicroughness, base_color=0.5, metallic=0, roughness=0.5, shadowing="direct")

ROWS = [
    row("default"),
    row("metal", base_color=0.9, metallic=1.0, roughness=0.4),
    row("rough metal", base_color=0.9, metallic=1.0, roughness=1.0),
    row("half metal ibl", shadowing="ibl", base_color=0.7, metallic=0.5, roughness=0.6),
    row("smith", shadowing="smith", base_color=0.6, metallic=0.2, roughness=0.7),
    row("sharp ibl", sharp=True, shadowing="ibl", roughness=0.15),
    row("black smith", shadowing="smith", base_color=0.0, roughness=0.3),
    row("white", base_color=1.0, roughness=0.8),
]

EXTREME = [
    row(f"{shadowing} roughness {r:g}", shadowing=shadowing, base_color=0.7, metallic=1.0, roughness=r)
    for shadowing in ("direct", "ibl", "smith")
    for r in (0.01, 0.032, 1.0)
]

SMOOTH = {
    f"metallicroughness {shadowing}": {
        "type": "metallicroughness", "base_color": 0.6, "metallic": 0.6, "roughness": 0.45, "shadowing": shadowing,
    }
    for shadowing in ("direct", "ibl", "smith")
}  # fmt: skip
