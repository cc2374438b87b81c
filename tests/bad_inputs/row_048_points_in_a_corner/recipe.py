"""Row 48: All common points in one corner of the model."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.normal_case import grid, normal_case, seen

STATIONS = {"1-1": (0.0, 0.0, 1000.0), "1-2": (600.0, 0.0, 1000.0)}
POINTS = grid((500.0, 560.0, 4), (600.0, 660.0, 3))


def make(folder: Path) -> list[str] | None:
    normal_case(folder, STATIONS, POINTS, seen(STATIONS, POINTS), until="models")
    return None
