"""Covariances between chosen points of an adjusted block, for comparisons of points with each other."""

from collections.abc import Sequence
from fnmatch import fnmatchcase

import numpy as np

from aatri.adjustment.covariance.cross import joint_covariance
from aatri.arrays import Int
from aatri.artifacts.block import Block
from aatri.artifacts.solution import PointCovariances
from aatri.errors import InputError, ResourceError
from aatri.frames.tangent import TangentFrame
from aatri.ids import printable, several
from aatri.observations.poses import POINT
from aatri.orientation.bundle.free_datum import transformation_of
from aatri.orientation.bundle.result import BundleResult

MOST_POINTS = 3000
"""The matrix of so many points takes 650 MB, and as much again while it is made."""


def chosen_points(block: Block, patterns: Sequence[str]) -> Int:
    """Rows of the points whose ids match one of the patterns (`*`, `?`, `[abc]`).

    Raises
    ------
    InputError
        If nothing matches a pattern.
    """
    ids, rows = block.points.id.tolist(), set[int]()
    for pattern in patterns:
        matching = [k for k, name in enumerate(ids) if fnmatchcase(name, pattern)]
        if not matching:
            raise InputError(
                f"no point has an id like {printable(pattern)}",
                where="options of bundle_adjustment/bundle: point_covariances",
                remedy=f"the block has {several(len(ids), 'point')}: {', '.join(map(printable, ids[:5]))} ...",
            )
        rows.update(matching)
    return np.array(sorted(rows), dtype=np.int64)


def point_covariances(
    block: Block, result: BundleResult, frame: TangentFrame | None, patterns: Sequence[str]
) -> PointCovariances | None:
    """Covariances of the chosen points that are determined, in the frame of the block.

    Raises
    ------
    InputError
        If nothing matches a pattern.
    ResourceError
        If the matrix is too large.
    """
    if not patterns:
        return None
    determined = result.point_adjusted & np.isfinite(result.point_covariance_m2).all(axis=(1, 2))
    rows = chosen_points(block, patterns)
    rows = rows[determined[rows]]
    n = len(rows)
    if not n:
        return None
    if n > MOST_POINTS:
        raise ResourceError(
            f"covariances between {n} points, more than {MOST_POINTS}",
            where="options of bundle_adjustment/bundle: point_covariances",
            remedy="choose fewer points by their ids",
        )
    free = None if result.free is None else transformation_of(result.free, result.adjusted, determined)
    Q = joint_covariance(result.adjusted, POINT, rows, free).reshape(n, 3, n, 3).swapaxes(1, 2)
    if frame is not None:
        D = frame.derivatives_at(result.adjusted.state[POINT][rows])
        Q = D[:, None] @ Q @ D.swapaxes(1, 2)[None]
    if result.absent is not None:
        absent = result.absent[rows]
        Q[absent[:, None, :, None] | absent[None, :, None, :]] = np.nan
    first, second = np.triu_indices(n)
    return PointCovariances(rows[first].astype(np.int32), rows[second].astype(np.int32), Q[first, second])
