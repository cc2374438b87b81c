"""Row 50: All points on a cylinder through both centres."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.bad_inputs.normal_case import normal_case, seen

STATIONS = {"1-1": (0.0, 0.0, 1000.0), "1-2": (600.0, 0.0, 1000.0)}
POINTS = {
    f"p{i}{j}": (x, float(500 * np.sin(t)), float(500 - 500 * np.cos(t)))
    for i, x in enumerate((-150.0, 100.0, 300.0, 500.0, 750.0))
    for j, t in enumerate(np.linspace(-1.2, 1.2, 6))
}


def make(folder: Path) -> list[str] | None:
    normal_case(folder, STATIONS, POINTS, seen(STATIONS, POINTS), until="models")
    return None
