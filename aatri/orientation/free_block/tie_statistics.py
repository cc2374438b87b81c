"""Test statistics of tied strips, and what must be added to the standard deviations of their points.

The deformation tau: with weights W = (C + tau^2 I)^-1 the residuals of the strips' points shall be as large as their
redundancy says, sum v'W v = sum of redundancy numbers; the robust form asks it of the median. The sum falls with tau,
so bisection finds it; tau is zero where the residuals are small enough without.

Source: Paule & Mandel 1982 (added variance); Foerstner 1979 (variance components by redundancy); Baarda 1968.
"""

from __future__ import annotations

import numpy as np

from aatri.adjustment.statistics.reliability import UNCONTROLLED
from aatri.arrays import Bool, Float
from aatri.orientation.free_block.tie_elimination import Eliminated, Linearised, Observations

MEDIAN_CHI2_3 = 2.366
"""Median of chi-square with three degrees of freedom."""

MAX_SHARE = 0.15
"""At most this share of a strip's ties, and of control, is rejected: where more disagrees the model is wrong, not the
data, and to go on rejecting would cut the strip off."""


def record_tests(system: Eliminated, cofactor: Float, use: Bool) -> tuple[Float, Float]:
    """Estimated gross error and test statistic of every observation (see adjustment.snooping).

    Parameters
    ----------
    system : Eliminated
    cofactor : (n, 3, 3) float64
        Of the whitened residuals.
    use : (n,) bool

    Returns
    -------
    size : (n, 3) float64
        In standard deviations.
    test : (n,) float64
        NaN where an observation cannot be tested.
    """
    values, vectors = np.linalg.eigh(cofactor)
    controlled = values > UNCONTROLLED
    projected = np.einsum("nji,nj->ni", vectors, np.nan_to_num(system.v))
    scaled = np.where(controlled, projected / np.where(controlled, values, 1.0), 0.0)
    rows = np.where(np.isnan(system.v).any(1), 0, controlled.sum(1))
    test = np.where(rows > 0, np.sqrt((projected * scaled).sum(1) / np.maximum(rows, 1)), np.nan)
    size = np.where(use[:, None], -np.einsum("nij,nj->ni", vectors, scaled), -system.v)
    return size, test


def clearest_errors(test: Float, o: Observations, covariance_m2: Float, use: Bool, limit: float) -> Bool:
    """The clearest gross errors: one per point, those at least half as large as the largest, few of each strip."""
    wrong = np.zeros(len(test), dtype=bool)
    candidates = np.flatnonzero(use & (test > limit))
    if not len(candidates):
        return wrong
    # Two observations of a point share one test: control is named before a strip, the less precise before the other.
    variance = np.einsum("nii->n", covariance_m2[candidates])
    order = candidates[np.lexsort((-variance, o.strip[candidates] >= 0, -np.round(test[candidates], 6)))]
    order = order[test[order] >= 0.5 * test[order[0]]]
    shared = np.bincount(o.point, minlength=o.n_points)[o.point] > 1
    source = o.strip + 1  # control, then the strips
    room = np.ceil(MAX_SHARE * np.bincount(source[shared], minlength=source.max() + 1)).astype(int)
    room -= np.bincount(source[~use & shared], minlength=len(room))
    # In a small problem one rejection changes the tests of all others: one at a time.
    most = max(1, len(test) // 100)
    points: set[int] = set()
    for k in order:
        if len(points) < most and room[source[k]] > 0 and int(o.point[k]) not in points:
            wrong[k] = True
            room[source[k]] -= 1
            points.add(int(o.point[k]))
    return wrong


def deformation(
    o: Observations, linear: Linearised, system: Eliminated, cofactor: Float, use: Bool, robust: bool
) -> float:
    """The tau that makes the residuals of the strips' points as large as their redundancy says."""
    share = np.einsum("nii->n", cofactor) / 3
    rows = use & (o.strip >= 0) & (share > 0.02) & ~np.isnan(system.v).any(1)
    values, vectors = np.linalg.eigh(linear.covariance_m2[rows])
    if 3 * share[rows].sum() < 1 or values.max(initial=0.0) <= 0:
        return 0.0
    v = system.point_m[o.point[rows]] - linear.xyz_m[rows]
    squares = np.einsum("nji,nj->ni", vectors, v) ** 2
    values = np.maximum(values, 1e-12 * values.max())

    def excess(tau: float) -> float:
        q = (squares / (values + tau**2)).sum(1)
        if robust:
            return float(np.median(q / share[rows])) / MEDIAN_CHI2_3 - 1
        return float(q.sum() / (3 * share[rows].sum())) - 1

    if excess(0.0) <= 0:
        return 0.0
    low, high = 0.0, float(np.sqrt(values.max()))
    while excess(high) > 0:
        low, high = high, 4 * high
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) > 0 else (low, middle)
    return 0.5 * (low + high)
