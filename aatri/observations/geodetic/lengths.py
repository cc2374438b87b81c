"""Values measured along a line (e, n, u) in the axes of its station, with their derivatives by it.

    slope distance       d = |l|                  horizontal distance   s = sqrt(e^2 + n^2)
    direction, azimuth   t = atan2(e, n)          zenith angle          z = atan2(s, u)

Source: docs/formulas.md 5.4; Kraus, Photogrammetry.
"""

import numpy as np

from aatri.arrays import Float


def slope(line: Float) -> tuple[Float, Float]:
    """Length of the line, m."""
    length = np.sqrt(np.einsum("ni,ni->n", line, line))
    return length, line / length[:, None]


def horizontal(line: Float) -> tuple[Float, Float]:
    """Length of the line in the horizon of the station, m."""
    plan = line * np.array([1.0, 1.0, 0.0])
    return slope(plan)


def bearing(line: Float) -> tuple[Float, Float]:
    """Angle from north, clockwise, rad."""
    e, n = line[:, 0], line[:, 1]
    square = e**2 + n**2
    return np.arctan2(e, n), np.column_stack([n / square, -e / square, np.zeros_like(e)])


def zenith(line: Float) -> tuple[Float, Float]:
    """Angle from the vertical, rad."""
    e, n, u = line.T
    s, square = np.sqrt(e**2 + n**2), (line**2).sum(axis=1)
    return np.arctan2(s, u), np.column_stack([u * e / s, u * n / s, -s]) / square[:, None]
