"""Row 48: All common points on one line along the base."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.normal_case import grid, normal_case, seen

STATIONS = {"1-1": (0.0, 0.0, 1000.0), "1-2": (600.0, 0.0, 1000.0)}
POINTS = grid((-200.0, 800.0, 12), (0.0, 0.0, 1))


def make(folder: Path) -> list[str] | None:
    normal_case(folder, STATIONS, POINTS, seen(STATIONS, POINTS), until="models")
    return None
