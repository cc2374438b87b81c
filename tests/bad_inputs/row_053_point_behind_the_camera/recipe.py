"""Row 53: Three points whose rays meet behind the cameras."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.normal_case import grid, normal_case, seen

STATIONS = {"1-1": (0.0, 0.0, 1000.0), "1-2": (600.0, 0.0, 1000.0)}
POINTS = grid((-700.0, 1300.0, 9), (-800.0, 800.0, 5))


def make(folder: Path) -> list[str] | None:
    rows = seen(STATIONS, POINTS)
    first = {point: x for image, point, x, _ in rows if image == "1-1"}
    wrong = [
        (image, point, first[point] + 9.0 if image == "1-2" and point in ("p42", "p44", "p50") else x, y)
        for image, point, x, y in rows
    ]
    normal_case(folder, STATIONS, POINTS, wrong, until="models")
    return None
