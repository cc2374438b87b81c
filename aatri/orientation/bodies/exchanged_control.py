"""Two control points with each other's number, found before a component is oriented by its control.

A similarity of all that is known in full, control and positions, is fitted as given, and with each two control points
exchanged. Two are exchanged if that leaves less than `EXPLAINED` of the sum of distances, and no other two leave less
than `ALONE` times as much. They do not take part in the start, which they would spoil, and are held against the
orientation by the others.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from aatri.arrays import Bool, Float
from aatri.geometry.similarity import closed_form, transform

EXPLAINED, ALONE = 0.1, 2.0

FEWEST, MOST = 5, 40
"""Points without which two cannot be told, three must be left; more than the latter are no matter of two numbers."""

BESIDE = 40
"""Positions that are fitted beside the control: so many, evenly taken, show which two are exchanged."""


def exchanged_control(x: Float, X: Float, n_control: int | None = None, fewest: int = FEWEST) -> Bool:
    """Which of some points are exchanged, (n,): two of them, or none.

    Parameters
    ----------
    x, X : (n, 3) float64
        In the component, and on the ground, m.
    n_control : int, optional
        The first points are control, the others positions, whose numbers nobody exchanges; default: all are control.
    fewest : int
        Of all points.
    """
    exchanged = np.zeros(len(x), dtype=bool)
    control = len(x) if n_control is None else n_control
    if not 2 <= control <= MOST or len(x) < fewest or not np.ptp(x, axis=0).any():
        return exchanged
    step = max(1, (len(x) - control) // BESIDE)
    taken = np.append(np.arange(control), np.arange(control, len(x), step))
    x, X = x[taken], X[taken]

    def misfit(order: list[int]) -> float:
        return float(np.linalg.norm(transform(closed_form(x, X[order]), x) - X[order], axis=1).sum())

    as_given = list(range(len(x)))
    left = []
    for a, b in combinations(range(control), 2):
        order = as_given.copy()
        order[a], order[b] = b, a
        left.append((misfit(order), a, b))
    left.sort()
    second = left[1][0] if len(left) > 1 else np.inf
    if left[0][0] < EXPLAINED * misfit(as_given) and second > ALONE * left[0][0]:
        exchanged[list(left[0][1:])] = True
    return exchanged
