"""Folds of a distortion: where two places of the ideal image come to lie at one place of the measured one.

A map of the plane has not folded between the axis and a point as long as the determinant of its derivative is positive
on the way. It is tested at all points, and all along the way to the outermost ones, which pass where the others lie.
"""

from collections.abc import Callable

import numpy as np

from aatri.arrays import Float

OUTERMOST = 1000
"""Number of points the way to which is tested."""

CHUNK = 10_000
"""Points at a time, whose derivatives stay in the cache."""


def first_folded(derivative: Callable[[Float], Float], points: Float) -> int | None:
    """The first point that lies beyond a fold, or None.

    Parameters
    ----------
    derivative : callable
        (n, 2) -> (n, 2, 2)
    points : (n, 2) float64
        From the axis.

    Returns
    -------
    int or None
        Row of the point.
    """
    every, most = np.arange(len(points)), min(OUTERMOST, len(points))
    outermost = np.argpartition(-(points**2) @ np.ones(2), most - 1)[:most] if most else every
    chunks = [every[first : first + CHUNK] for first in range(0, len(every), CHUNK)]
    for rows, share in [*((chunk, 1.0) for chunk in chunks), *((outermost, s) for s in np.linspace(0.1, 0.9, 9))]:
        J = derivative(share * points[rows])
        folded = ~(J[:, 0, 0] * J[:, 1, 1] - J[:, 0, 1] * J[:, 1, 0] > 0)
        if folded.any():
            return int(rows[folded].min())
    return None
