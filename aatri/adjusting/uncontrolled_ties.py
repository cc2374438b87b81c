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
from aatri.adjusting.tied_solution import TiedSolution
from aatri.adjustment.statistics.uncontrolled import uncontrolled_directions
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
    each = zip(problem.observed, edges, solved.tests, solved.whiteners)
    parts = [
        (first, tests.redundancy, T, among[first : first + len(o)]) for o, first, tests, T in each if is_coordinates(o)
    ]
    rows = np.concatenate([first + np.flatnonzero(active) for first, _, _, active in parts])
    R = np.concatenate([redundancy[active] for _, redundancy, _, active in parts])
    T = np.concatenate([whitener[active] for _, _, whitener, active in parts])
    M = solved.variance_with_body[rows][:, None, None] / 3 * (T.swapaxes(1, 2) @ R @ T)
    weak, least, direction = uncontrolled_directions(M, problem.components[rows], np.ones((len(rows), 3)))
    return rows[weak], np.maximum(least, 0.0), direction
