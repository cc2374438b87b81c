"""Starts of relative orientations by five-point samples, of which the orientation counts that most points fit.

Who needs them for few pairs imports this module when there are any: its compiled loops (`kernels.consensus`) are a
fifth of all that aatri compiles.
"""

import numpy as np

from aatri.arrays import Float, Int
from aatri.geometry.rotations import angles_between, nearest_rotation
from aatri.orientation.relative.kernels.consensus import JUDGES, KEPT, consensus
from aatri.orientation.relative.limits import AS_GOOD, AS_GOOD_OF_FEW, LEAST_SHARE_OF_MODEL, NEARER
from aatri.orientation.relative.loops import Portion

SAMPLES = 1_000
"""Most samples of a pair."""


class FromConsensus:
    """Start of pairs by the essential matrix of five points that most points fit.

    Parameters
    ----------
    start : (m + 1,) int
        First point of each pair.
    fewest : int
        Pairs with fewer points get no start.
    expected : (m, 3, 3) float64, optional
        Rotations that decide between orientations over a plane; NaN where unknown.

    Attributes
    ----------
    second : (m, 3, 4) float64
        Rotation and base of another orientation that explains the points as well; NaN where there is none.
    samples : (m,) int64
        Five-point samples drawn.
    share : (m,) float64
        Of the points that fit.
    """

    def __init__(self, start: Int, max_samples: int = SAMPLES, fewest: int = 5, expected: Float | None = None) -> None:
        m = len(start) - 1
        self.expected = np.full((m, 3, 3), np.nan) if expected is None else expected
        self.max_samples, self.fewest = max_samples, fewest
        self.second, self.samples, self.share = np.full((m, 3, 4), np.nan), np.zeros(m, dtype=np.int64), np.zeros(m)

    def __call__(self, portion: Portion) -> None:
        """Start the pairs of a portion."""
        pair, count = portion.pair, portion.count
        portion.chosen[:] &= count >= self.fewest
        poses, costs = np.full((len(count), KEPT, 3, 4), np.nan), np.full((len(count), KEPT), np.inf)
        drawn, fits = np.zeros(len(count), dtype=np.int64), np.zeros(len(portion.active), dtype=bool)
        portion.all_pairs(consensus, portion.chosen, portion.table, self.max_samples, poses, costs, drawn, fits)
        portion.chosen[:] &= np.isfinite(costs[:, 0])
        # of five points, or of a plane, they are rotations to some digits only, and what follows turns them as they are
        finite = np.isfinite(costs)
        poses[finite, :, :3] = nearest_rotation(poses[finite, :, :3])
        portion.pose[:] = poses[:, 0]
        portion.active[:] &= fits
        row = np.repeat(np.arange(len(count)), count)
        self.samples[pair] = drawn
        fitting = np.bincount(row[fits], minlength=len(count))
        self.share[pair] = fitting / np.maximum(count, 1)
        for k in np.flatnonzero(portion.chosen & (self.share[pair] < LEAST_SHARE_OF_MODEL)).tolist():
            portion.reasons[int(pair[k])] = f"only {fitting[k]} of {count[k]} points fit one orientation"
        limit = np.maximum(AS_GOOD_OF_FEW, AS_GOOD * 2.0 * np.sqrt(np.minimum(count, JUDGES)) / 9.0)
        also = portion.chosen & (costs[:, 1] - np.where(portion.chosen, costs[:, 0], 0.0) <= limit)
        first_off, second_off = (angles_between(poses[:, k, :, :3], self.expected[pair]) for k in (0, 1))
        exchanged = also & (second_off < NEARER * first_off)
        portion.pose[exchanged] = poses[exchanged, 1]
        undecided = also & ~exchanged & ~(first_off < NEARER * second_off)
        self.second[pair[undecided]] = poses[undecided, 1]
