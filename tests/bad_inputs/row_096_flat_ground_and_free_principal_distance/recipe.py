"""Row 96: Vertical images of flat ground, control only, the principal distance free."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import Tables
from tests.bad_inputs.normal_case import grid, normal_case, seen

STATIONS = {"1-1": (0.0, 0.0, 1000.0), "1-2": (600.0, 0.0, 1000.0), "1-3": (1200.0, 0.0, 1000.0)}
POINTS = grid((-700.0, 1900.0, 12), (-800.0, 800.0, 5), 0.0)


def free(tables: Tables) -> None:
    lens = "{model: none}"
    tables["block.yaml"] = tables["block.yaml"].replace(lens, f"{lens}, sigmas: {{principal_distance: .inf}}")


def make(folder: Path) -> list[str] | None:
    normal_case(
        folder,
        STATIONS,
        POINTS,
        seen(STATIONS, POINTS),
        free,
        control=("p20", "p24", "p90", "p94", "p52"),
        until="bundle",
    )
    return None
