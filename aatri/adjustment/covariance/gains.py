"""Gains: how an error of an observation moves the unknowns that the observation touches.

    K = Q J'      of every record: the change of the blocks it touches per unit of its whitened observations

of which a gross error of size e (whitened) moves them by K e: external reliability, seen at the own point and image.
Q of a ray's block p and kept unknowns k comes from the way down the tree; with X = -Q_kp

    K_k = Q_kk A' - X B',    K_p = Q_pp B' - X'A'

Under exact constraints K loses W (J W)', see `constrained`; for a free datum see `s_transformation`.
Source: Baarda 1968; Foerstner 1979.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from aatri.adjustment.kernels.ray_gains import ray_gains
from aatri.adjustment.records import Records
from aatri.adjustment.structure.index import group_sizes
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.arrays import Float, Int


@dataclass(frozen=True)
class Gains:
    """Gains of one observation type."""

    group: tuple[str, ...]
    """Of each touched block."""
    columns: tuple[slice, ...]
    """Columns of each among the Jacobians laid side by side."""
    eliminated: str
    """The group of which blocks are eliminated."""
    gain: tuple[Float | None, ...]
    """Tuple of (n, k, m). Of each touched block, by row of the records; None where not wanted, NaN where not known."""

    def of(self, group: str) -> Float | None:
        """Gain of the first touched block of a group, (n, k, m); None if there is none."""
        return next((g for name, g in zip(self.group, self.gain) if name == group), None)


def empty_gains(records: Records, problem: IndexedProblem, of_groups: Collection[str]) -> Gains:
    """Gains that are still to be filled in."""
    size, n, first, columns, gain = group_sizes(problem.unknowns), len(records.active), 0, [], []
    for group, _ in records.touches:
        columns.append(slice(first, first + size[group]))
        gain.append(np.full((n, size[group], records.rows), np.nan) if group in of_groups else None)
        first += size[group]
    groups = tuple(group for group, _ in records.touches)
    return Gains(groups, tuple(columns), problem.layout.eliminated, tuple(gain))


def take_gains(gains: Gains, rows: Int, K: Float) -> None:
    """Fill in the gains of some rows, from those of all touched blocks on top of each other, (n, columns, m)."""
    for columns, gain in zip(gains.columns, gains.gain):
        if gain is not None:
            gain[rows] = K[:, columns]


def gains_of_rays(
    gains: Gains, rows: Int, A: Float, B: Float, row: Int, S: Float, X: Float, block: Int, Q: Float
) -> None:
    """Fill in the gains of some rays of eliminated blocks.

    Parameters
    ----------
    A, B : (n, m, columns), (n, m, 3) float64
        Zero for unknowns that are held.
    row : (n, columns) int
        Row of the front of each column of A, -1 where held.
    S : (size, size) float64, column-major
        Covariance of the front.
    X : (n, columns, 3) float64
        Minus the covariance of the kept unknowns with the block.
    block : (n,) int
        Block of each ray.
    Q : (n_blocks, 3, 3) float64
        Covariances of the blocks.
    """
    n, m, k = A.shape
    kept, own = np.empty((n, k, m)), np.empty((n, 3, m))
    ray_gains(A, B, np.ascontiguousarray(row, np.int64), S, X, np.ascontiguousarray(block, np.int64), Q, kept, own)
    first = 0
    for group, columns, gain in zip(gains.group, gains.columns, gains.gain):
        width = columns.stop - columns.start
        if group == gains.eliminated:
            part_gain = own
        else:
            part_gain = kept[:, first : first + width]
            first += width
        if gain is not None:
            gain[rows] = part_gain


def reduce_gains(gains: Gains, records: Records, rows: Int, W: Mapping[str, Float], T: Float) -> None:
    """Take W (J W)' off the gains of some rows; T = J W, (n, m, d)."""
    for (group, block), gain in zip(records.touches, gains.gain):
        if gain is not None:
            gain[rows] -= W[group][block[rows]] @ T.swapaxes(1, 2)
