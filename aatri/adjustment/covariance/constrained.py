"""Covariances under exact constraints: those of N reduced by W W', in every block and every record.

    Q = N^-1 - Z S^-1 Z' = N^-1 - W W',    W = Z R^-T,    S = R R'          (see `constraints`)

A record with Jacobian J loses J W (J W)'.
"""

from collections.abc import Collection, Mapping

import numpy as np

from aatri.adjustment.constraints.multipliers import gram, linearised_constraints
from aatri.adjustment.covariance.gains import Gains, reduce_gains
from aatri.adjustment.elimination.factor import Factored
from aatri.adjustment.elimination.right_hand_sides import backward, forward, sides_of
from aatri.adjustment.kernels.eliminate import RANK_TOLERANCE
from aatri.adjustment.records import CHUNK, predicted, times
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.unknowns import State
from aatri.arrays import Float


def covariance_reduction(problem: IndexedProblem, factored: Factored, state: State) -> dict[str, Float]:
    """W by group and block, (n, k, number of constraints) each; nothing without constraints."""
    if not problem.constraints:
        return {}
    _, right = linearised_constraints(problem, state)
    u = forward(problem, factored, state, right)
    R = np.linalg.cholesky(gram(problem, u))
    Z = backward(problem, factored, state, u)
    return {group: np.linalg.solve(R, z.swapaxes(1, 2)).swapaxes(1, 2) for group, z in Z.items()}


def covariance_times(
    problem: IndexedProblem,
    factored: Factored,
    state: State,
    W: Mapping[str, Float],
    right: Mapping[str, Float],
    of_groups: Collection[str] | None = None,
) -> dict[str, Float]:
    """The covariance of all unknowns times right-hand sides, (n, k, m) by group; groups that are missing are zero.

    W is that of `covariance_reduction`, made once for several products; `of_groups` are the groups asked for, or all.
    """
    product = backward(problem, factored, state, forward(problem, factored, state, sides_of(problem, right)), of_groups)
    if not W:
        return product
    common = sum(np.einsum("nkc,nks->cs", W[group], values) for group, values in right.items())
    return {group: values - W[group] @ common for group, values in product.items()}


def reduce_covariances(
    problem: IndexedProblem,
    state: State,
    W: Mapping[str, Float],
    groups: Mapping[str, Float],
    records: tuple[Float, ...],
    gains: tuple[Gains, ...] = (),
) -> None:
    """Take W W' off the covariances of all blocks and records, and off the gains, in place."""
    for group, w in W.items():
        before = np.einsum("nii->ni", groups[group]).copy()
        groups[group][:] -= w @ w.swapaxes(1, 2)
        # A scalar that the constraints fix has no variance, but for the rounding of the difference.
        block, scalar = np.nonzero(np.einsum("nii->ni", groups[group]) <= RANK_TOLERANCE * before)
        groups[group][block, scalar] = groups[group][block, :, scalar] = 0.0
    for place, (r, of_record) in enumerate(zip(problem.records, records)):
        determined = np.flatnonzero(np.isfinite(of_record).all(axis=(1, 2)))
        for first in range(0, len(determined) if W else 0, CHUNK):
            rows = determined[first : first + CHUNK]
            T = times(r, rows, predicted(r, state, rows)[1], W)
            of_record[rows] -= T @ T.swapaxes(1, 2)
            if gains:
                reduce_gains(gains[place], r, rows, W, T)
