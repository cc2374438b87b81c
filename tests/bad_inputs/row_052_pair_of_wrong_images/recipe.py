"""Row 52: An image of another place under the ids of this one: every point is wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.bad_inputs.normal_case import grid, normal_case, seen

STATIONS = {"1-1": (0.0, 0.0, 1000.0), "1-2": (600.0, 0.0, 1000.0)}
POINTS = grid((-250.0, 850.0, 9), (-800.0, 800.0, 5))


def make(folder: Path) -> list[str] | None:
    rows = seen(STATIONS, POINTS)
    order = np.random.default_rng(3).permutation(len(POINTS))
    other = dict(zip(POINTS, (list(POINTS)[k] for k in order)))
    wrong = [(image, other[point] if image == "1-2" else point, x, y) for image, point, x, y in rows]
    normal_case(folder, STATIONS, POINTS, wrong, until="models")
    return None
