"""Row 67: All control within one corner of the block."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.normal_case import grid, normal_case, seen

STATIONS = {"1-1": (0.0, 0.0, 1000.0), "1-2": (600.0, 0.0, 1000.0), "1-3": (1200.0, 0.0, 1000.0)}
POINTS = grid((-700.0, 1900.0, 14), (-800.0, 800.0, 9))


def make(folder: Path) -> list[str] | None:
    normal_case(folder, STATIONS, POINTS, seen(STATIONS, POINTS), control=("p30", "p32", "p50"), until="absolute")
    return None
