"""Row 54: The coordinates of the first image copied to the second."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.normal_case import grid, normal_case, seen

STATIONS = {"1-1": (0.0, 0.0, 1000.0), "1-2": (600.0, 0.0, 1000.0)}
POINTS = grid((-700.0, 1300.0, 9), (-800.0, 800.0, 5))


def make(folder: Path) -> list[str] | None:
    rows = [r for r in seen(STATIONS, POINTS) if r[0] == "1-1"]
    normal_case(folder, STATIONS, POINTS, [*rows, *(("1-2", *r[1:]) for r in rows)], until="models")
    return None
