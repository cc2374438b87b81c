"""Data snooping of small problems, compiled: which record is rejected, and which comes back.

The record with the largest test statistic above the limit goes first; where none is above it, the rejected record with
the smallest prediction error over its standard deviation sqrt(1 + j'Qj), below the limit, comes back. A problem adjusts and tests its records by itself; records are single residuals, `test`
stands in a column of an array of its own.

Source: Baarda 1968; Foerstner 1980.
"""

import numpy as np
from numba import njit

from aatri.adjustment.kernels.small import OPTIONS

UNCONTROLLED = 1e-6
"""Redundancy numbers below this count as zero."""


@njit("int64(boolean[::1])", **OPTIONS)
def count(chosen):
    """How many are chosen."""
    n = 0
    for k in range(len(chosen)):
        if chosen[k]:
            n += 1
    return n


@njit("UniTuple(int64, 2)(boolean[::1], boolean[::1], float64[:,::1], int64, float64)", **OPTIONS)
def worst_and_best(inside, active, table, column, limit):
    """The active record with the largest test statistic, and the other one with the smallest below the limit; else -1.

    Parameters
    ----------
    inside : (n,) bool
        Records that may be used.
    active : (n,) bool
        Records used.
    table : (n, columns) float64
        With the test statistics in one column; NaN where uncontrolled.
    """
    worst, best, largest, smallest = -1, -1, 0.0, limit
    for k in range(len(table)):
        test = table[k, column]
        if active[k] and largest < test < np.inf:
            worst, largest = k, test
        elif inside[k] and not active[k] and test < smallest:
            best, smallest = k, test
    return worst, best
