"""Row 51: A third of the points of a pair matched wrongly."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.normal_case import grid, normal_case, seen

STATIONS = {"1-1": (0.0, 0.0, 1000.0), "1-2": (600.0, 0.0, 1000.0)}
POINTS = grid((-700.0, 1300.0, 9), (-800.0, 800.0, 5))


def mismatched(row: tuple[str, str, float, float]) -> tuple[str, str, float, float]:
    image, point, x, y = row
    number = int(point[1]) * 5 + int(point[2])
    return (image, point, x, y + 9.0 * (1 + number % 4)) if image == "1-2" and number % 3 == 0 else row


def make(folder: Path) -> list[str] | None:
    rows = [mismatched(r) for r in seen(STATIONS, POINTS)]
    normal_case(folder, STATIONS, POINTS, rows, until="models")
    return None
