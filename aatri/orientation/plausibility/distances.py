"""Distances between control points held against their coordinates: a scale that all of them have in common.

    d = (1 + s) |X_i - X_j| + v,    weights 1 / (sigma_d^2 + sigma_i^2 + sigma_j^2)

Distances of a map, at another height or of another unit differ by one s; it is told where it is beyond three standard
deviations and explains them all. An adjustment smears it over control and images, and its search for gross errors takes
single distances for wrong. Cf. row 112 of common input errors.
"""

from __future__ import annotations

import numpy as np

from aatri.arrays import Float
from aatri.notes import Note

FEWEST = 3
SIGNIFICANT = 3.0
LEAST = 1e-5
"""Smaller scales, 10 ppm, are matters of the instrument."""


def scale_notes(distance_m: Float, coordinates_m: Float, sigma_m: Float) -> list[Note]:
    """A warning where distances have another scale than coordinates.

    Parameters
    ----------
    distance_m, coordinates_m : (n,) float64, m
        As measured, and from the coordinates of the control points.
    sigma_m : (n,) float64, m
        Of their differences.
    """
    if len(distance_m) < FEWEST or not (sigma_m > 0).all():
        return []
    x, w = coordinates_m / sigma_m, (distance_m - coordinates_m) / sigma_m
    scale, sigma = float(x @ w / (x @ x)), float(1 / np.sqrt(x @ x))
    left = np.abs(w - scale * x)
    if abs(scale) < max(SIGNIFICANT * sigma, LEAST) or (left > SIGNIFICANT).any():
        return []
    how = "longer" if scale > 0 else "shorter"
    return [Note("warning", f"{len(x)} distances between control points are {1e6 * abs(scale):.0f} ppm (+- "
                 f"{1e6 * sigma:.0f}) {how} than their coordinates have them: are they reduced to a map or to another "
                 "height (`reduced`), or is a unit wrong?")]  # fmt: skip
