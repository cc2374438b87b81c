"""Row 86: A block of 45 km in a plane frame, without earth curvature."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.normal_case import grid, normal_case, seen

STATIONS = {f"1-{k + 1}": (9000.0 * k, 0.0, 15000.0) for k in range(5)}
POINTS = grid((-8000.0, 44000.0, 12), (-10000.0, 10000.0, 5), 300.0)


def make(folder: Path) -> list[str] | None:
    normal_case(
        folder, STATIONS, POINTS, seen(STATIONS, POINTS), control=("p10", "p14", "p90", "p94", "p52"), until="absolute"
    )
    return None
