"""Ties and given coordinates with a direction in which the others do not control them.

A gross error e of an observation, whitener T, changes the sum of squares of the adjustment by

    e' T' R T e,        R the cofactor of its whitened residuals.

It is compared with one standard deviation of the observation and of a strip's point together: precise control has a
redundancy number near zero beside strips ten times as rough, but its errors show in them. So the smallest eigenvalue of
s^2 T' R T is the redundancy number, and its eigenvector the direction, whatever the weights.

Source: Foerstner 1980, 1983 (a redundancy number of 0.01 is the limit of what is controlled).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.orientation.free_block.tie_records import GivenPoints
from aatri.orientation.free_block.tied_solution import WEAK, TiedSolution


def uncontrolled_observations(solved: TiedSolution[Any], among: Bool) -> tuple[Int, Float, Float]:
    """Observations in which a gross error of ten standard deviations, of them and a strip's point, shows not.

    Parameters
    ----------
    solved : TiedSolution
    among : (n,) bool
        Active observations to be looked at; of what is given only coordinates.

    Returns
    -------
    rows : (k,) int64
    least : (k,) float64
        Redundancy number in that direction.
    direction : (k, 3) float64
        Of length 1; zero where not given.
    """
    problem = solved.problem
    ties = np.ones((len(problem.ties.strip), 3), dtype=bool)
    begin, R, T, given, rows = 0, list[Float](), list[Float](), list[Bool](), list[Int]()
    for k, of in enumerate([ties, *(g.given for g in problem.given)]):
        mine = np.flatnonzero(among[begin : begin + len(of)])
        if k == 0 or isinstance(problem.given[k - 1], GivenPoints):
            R.append(solved.tests[problem.records[k].name].redundancy[mine])
            T.append(solved.whiteners[k][mine])
            given.append(of[mine])
            rows.append(begin + mine)
        begin += len(of)
    return _smallest(np.concatenate(rows), solved, np.concatenate(R), np.concatenate(T), np.concatenate(given))


def _smallest(rows: Int, solved: TiedSolution[Any], R: Float, T: Float, given: Bool) -> tuple[Int, Float, Float]:
    M = solved.variance_with_strip_m2[rows][:, None, None] / 3 * (T.swapaxes(1, 2) @ R @ T)
    M = np.where(given[:, :, None] & given[:, None, :], 0.5 * (M + M.swapaxes(1, 2)), np.eye(3))
    doubtful = np.flatnonzero(np.isfinite(M).all(axis=(1, 2)) & ~(_bound(M) > WEAK**-2))
    values, vectors = np.linalg.eigh(M[doubtful])
    found = values[:, 0] < WEAK**-2
    direction = vectors[found, :, 0]
    largest = np.take_along_axis(direction, np.abs(direction).argmax(axis=1)[:, None], axis=1)
    return rows[doubtful[found]], np.maximum(values[found, 0], 0.0), direction * np.where(largest < 0, -1.0, 1.0)


def _bound(M: Float) -> Float:
    """Of matrices without negative eigenvalues the smallest is at least det / (trace / 2)^2: most need no more."""
    trace = np.einsum("nii->n", M)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(4 * np.linalg.det(M) / trace**2)
