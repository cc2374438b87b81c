"""Row 61: The last of three images flown at half the height."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.normal_case import grid, normal_case, seen

STATIONS = {"1-1": (0.0, 0.0, 1000.0), "1-2": (300.0, 0.0, 1000.0), "1-3": (1000.0, 0.0, 1000.0)}
POINTS = grid((-700.0, 1900.0, 12), (-800.0, 800.0, 5))


def make(folder: Path) -> list[str] | None:
    normal_case(folder, STATIONS, POINTS, seen(STATIONS, POINTS))
    return None
