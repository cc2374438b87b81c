"""Row 47: Just five common points: no check of the relative orientation."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.normal_case import normal_case, seen

STATIONS = {"1-1": (0.0, 0.0, 1000.0), "1-2": (600.0, 0.0, 1000.0)}
POINTS = {
    "a": (0.0, -700.0, 10.0),
    "b": (20.0, 700.0, 20.0),
    "c": (600.0, -690.0, 0.0),
    "d": (590.0, 710.0, 30.0),
    "e": (300.0, 20.0, 5.0),
}


def make(folder: Path) -> list[str] | None:
    normal_case(folder, STATIONS, POINTS, seen(STATIONS, POINTS), until="models")
    return None
