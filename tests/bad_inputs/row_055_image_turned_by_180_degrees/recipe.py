"""Row 55: The second image turned by 180 degrees."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.normal_case import grid, normal_case, seen

STATIONS = {"1-1": (0.0, 0.0, 1000.0), "1-2": (600.0, 0.0, 1000.0)}
POINTS = grid((-700.0, 1300.0, 9), (-800.0, 800.0, 5))


def make(folder: Path) -> list[str] | None:
    rows = [(i, p, -x, -y) if i == "1-2" else (i, p, x, y) for i, p, x, y in seen(STATIONS, POINTS)]
    normal_case(folder, STATIONS, POINTS, rows, control=("p00", "p04", "p80", "p84"), until="bundle")
    return None
