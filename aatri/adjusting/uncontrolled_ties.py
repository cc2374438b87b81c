"""Ties and coordinates of the ground with a direction in which the others do not control them.

A gross error e of an observation, whitener T, changes the sum of squares of the adjustment by

    e' T' R T e,        R the cofactor of its whitened residuals.

It is compared with one standard deviation of the observation and of a body's point together: precise control has a
redundancy number near zero beside bodies ten times as rough, but its errors show in them. So the smallest eigenvalue of
s^2 T' R T is the redundancy number, and its eigenvector the direction, whatever the weights.

Source: Foerstner 1980, 1983 (a redundancy number of 0.01 is the limit of what is controlled).
"""

import numpy as np

from aatri.adjusting.tied_problem import is_coordinates
from aatri.adjusting.tied_solution import WEAK, TiedSolution
from aatri.arrays import Bool, Float, Int


def uncontrolled_observations(solved: TiedSolution, among: Bool) -> tuple[Int, Float, Float]:
    """Observations in which a gross error of ten standard deviations, of them and a body's point, shows not.

    Parameters
    ----------
    solved : TiedSolution
    among : (n,) bool
        Active observations to be looked at: ties, and coordinates of the ground.

    Returns
    -------
    rows : (k,) int64
    least : (k,) float64
        Redundancy number in that direction.
    direction : (k, 3) float64
        Of length 1; zero where not observed.
    """
    problem, edges = solved.problem, solved.problem.edges
    R, T, rows = list[Float](), list[Float](), list[Int]()
    for o, first, tests, whitener in zip(problem.observed, edges, solved.tests, solved.whiteners):
        if is_coordinates(o):
            mine = np.flatnonzero(among[first : first + len(o)])
            R.append(tests.redundancy[mine])
            T.append(whitener[mine])
            rows.append(first + mine)
    some = np.concatenate(rows)
    return _smallest(some, solved, np.concatenate(R), np.concatenate(T), problem.components[some])


def _smallest(rows: Int, solved: TiedSolution, R: Float, T: Float, given: Bool) -> tuple[Int, Float, Float]:
    M = solved.variance_with_body[rows][:, None, None] / 3 * (T.swapaxes(1, 2) @ R @ T)
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
