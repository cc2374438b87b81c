"""Row 55: The second image turned by 180 degrees: oriented all the same."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.normal_case import grid, normal_case, seen

STATIONS = {"1-1": (0.0, 0.0, 1000.0), "1-2": (600.0, 0.0, 1000.0)}
POINTS = grid((-300.0, 900.0, 7), (-700.0, 700.0, 5))


def make(folder: Path) -> list[str] | None:
    rows = [(i, p, -x, -y) if i == "1-2" else (i, p, x, y) for i, p, x, y in seen(STATIONS, POINTS)]
    normal_case(folder, STATIONS, POINTS, rows, control=("p10", "p14", "p50", "p54"), until="bundle")
    return None
