"""Row 59: Two points only that three successive images have in common."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.normal_case import grid, normal_case, seen

STATIONS = {"1-1": (0.0, 0.0, 1000.0), "1-2": (600.0, 0.0, 1000.0), "1-3": (1200.0, 0.0, 1000.0)}
POINTS = grid((-700.0, 1900.0, 12), (-800.0, 800.0, 5))


def make(folder: Path) -> list[str] | None:
    rows = seen(STATIONS, POINTS)
    third = [point for image, point, *_ in rows if image == "1-3"]
    first = [point for image, point, *_ in rows if image == "1-1" and point in third]
    gone = {("1-3", point) for point in first[2:]}
    normal_case(folder, STATIONS, POINTS, [r for r in rows if r[:2] not in gone])
    return None
