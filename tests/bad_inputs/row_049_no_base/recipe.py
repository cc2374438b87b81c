"""Row 49: Two images from one place, turned against each other by nothing."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.normal_case import grid, normal_case, seen

STATIONS = {"1-1": (0.0, 0.0, 1000.0), "1-2": (0.0, 0.0, 1000.0)}
POINTS = grid((-700.0, 1300.0, 9), (-800.0, 800.0, 5))


def make(folder: Path) -> list[str] | None:
    normal_case(folder, STATIONS, POINTS, seen(STATIONS, POINTS), until="models")
    return None
