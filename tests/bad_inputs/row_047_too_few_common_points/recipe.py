"""Row 47: Four points common to two images of a strip of three."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.normal_case import grid, normal_case, seen

STATIONS = {"1-1": (0.0, 0.0, 1000.0), "1-2": (600.0, 0.0, 1000.0), "1-3": (1200.0, 0.0, 1000.0)}
POINTS = grid((-700.0, 1900.0, 12), (-800.0, 800.0, 5))


def common(rows: list[tuple[str, str, float, float]]) -> list[str]:
    second = {point for image, point, *_ in rows if image == "1-2"}
    return [point for image, point, *_ in rows if image == "1-3" and point in second][:4]


def make(folder: Path) -> list[str] | None:
    rows = [r for r in seen(STATIONS, POINTS) if r[0] != "1-3" or r[1] in POINTS]
    few = common(rows)
    normal_case(folder, STATIONS, POINTS, [r for r in rows if r[0] != "1-3" or r[1] in few], positions=True)
    return None
