"""Covariances of the adjusted values of records that are not rays of eliminated blocks: A Q A', whitened.

Those of inactive records are covariances of predicted values.

A record of kept unknowns alone lies in one front, and so does its covariance; that of a record of one eliminated block
follows from the block's.
"""

import numpy as np

from aatri.adjustment.covariance.gains import Gains, take_gains
from aatri.adjustment.records import CHUNK, Records, predicted
from aatri.adjustment.structure.index import KeptRecords, part_columns
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.unknowns import State
from aatri.arrays import Float, Int


def kept_covariances(
    problem: IndexedProblem,
    kept: KeptRecords,
    A: Float,
    k: int,
    row_of: Int,
    S: Float,
    into: Float,
    gains: Gains | None = None,
) -> None:
    """Those of the kept records of a node, into `into`; of records that bring normal equations the variances alone.

    Parameters
    ----------
    A : (n, m, columns) float64
        Whitened Jacobians of all the kept records, active or not, zero where held.
    k : int
        The node.
    row_of : (n_kept,) int
        Row of its front for each kept column.
    S : (size, size) float64
        Covariance of its front.
    into : (n_records, m, m) float64
    gains : Gains, optional
        Filled in too.
    """
    for first in range(int(kept.first[k]), int(kept.first[k + 1]), CHUNK):
        chunk = slice(first, min(first + CHUNK, int(kept.first[k + 1])))
        row = row_of[part_columns(kept.parts, problem.layout, chunk)]
        K = S[row[:, :, None], row[:, None, :]] @ A[chunk].swapaxes(1, 2)
        if kept.records.normal is None:
            into[kept.rows[chunk]] = A[chunk] @ K
        else:  # very many rows
            into[kept.rows[chunk]] = np.einsum("nik,nki->ni", A[chunk], K)[:, :, None] * np.eye(kept.records.rows)
        if gains is not None:
            take_gains(gains, kept.rows[chunk], np.where((row >= 0)[:, :, None], K, 0.0))


def direct_covariances(
    problem: IndexedProblem, state: State, block: Float, into: tuple[Float, ...], gains: tuple[Gains, ...] = ()
) -> None:
    """Those of the records of one eliminated block alone, into `into`, from `block`, (n_blocks, 3, 3)."""
    for records, rows, number in problem.direct:
        _, (J,) = predicted(records, state, rows)
        place, K = place_of(problem, records), block[number] @ J.swapaxes(1, 2)
        into[place][rows] = J @ K
        if gains:
            take_gains(gains[place], rows, K)


def place_of(problem: IndexedProblem, records: Records) -> int:
    """Place of an observation type among those of the problem."""
    return next(i for i, r in enumerate(problem.records) if r is records)
