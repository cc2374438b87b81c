"""Two control points with each other's number, found before a component is oriented by its control.

A similarity of all points known in full is fitted as given, and with each two of them exchanged. Two are exchanged if
that leaves less than `EXPLAINED` of the sum of distances, and no other two leave less than `ALONE` times as much. They
do not take part in the start, which they would spoil, and are held against the orientation by the others.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from aatri.arrays import Bool, Float
from aatri.geometry.similarity import closed_form, transform

EXPLAINED, ALONE = 0.1, 2.0

FEWEST, MOST = 5, 40
"""Points without which two cannot be told, three must be left; more than the latter are no matter of two numbers."""


def exchanged_control(x: Float, X: Float) -> Bool:
    """Which of some points are exchanged, (n,): two of them, or none.

    Parameters
    ----------
    x, X : (n, 3) float64
        In the component, and on the ground, m.
    """
    found = np.zeros(len(x), dtype=bool)
    if not FEWEST <= len(x) <= MOST or not np.ptp(x, axis=0).any():
        return found

    def misfit(order: list[int]) -> float:
        return float(np.linalg.norm(transform(closed_form(x, X[order]), x) - X[order], axis=1).sum())

    as_given = list(range(len(x)))
    left = []
    for a, b in combinations(as_given, 2):
        order = as_given.copy()
        order[a], order[b] = b, a
        left.append((misfit(order), a, b))
    left.sort()
    if left[0][0] < EXPLAINED * misfit(as_given) and left[1][0] > ALONE * left[0][0]:
        found[list(left[0][1:])] = True
    return found
