"""Points of a Solution, or as a Block gives them, with all their covariances, for the comparison of epochs."""

import numpy as np

from aatri.arrays import Float
from aatri.artifacts.block import NO_ROLE, Block
from aatri.artifacts.solution import Solution
from aatri.errors import InputError
from aatri.evaluation.epochs import EpochPoints


def solved_points(solution: Solution, port: str) -> EpochPoints:
    """Points of a Solution whose covariances with each other it has.

    Raises
    ------
    InputError
        If it has none.
    """
    pairs = solution.point_covariances
    if pairs is None or not len(pairs):
        raise InputError(
            "the solution has no covariances between its points",
            where=f"port {port}",
            remedy='adjust it with `point_covariances: ["*"]` of bundle_adjustment/bundle, or the ids to be compared',
        )
    rows = np.unique(pairs.first)
    first, second = np.searchsorted(rows, pairs.first), np.searchsorted(rows, pairs.second)
    C = np.full((len(rows), 3, len(rows), 3), np.nan)
    C[second, :, first] = pairs.covariance_m2.swapaxes(1, 2)
    C[first, :, second] = pairs.covariance_m2
    return EpochPoints(solution.points.id[rows], solution.points.xyz_m[rows], C)


def surveyed_points(block: Block, port: str) -> EpochPoints:
    """Ground points as a Block gives them; approximate ones are none.

    Raises
    ------
    InputError
        If it gives none.
    """
    ground = block.ground_points
    rows = np.flatnonzero((ground.role != NO_ROLE).any(axis=1))
    if not len(rows):
        raise InputError(
            "the block gives no control or check points",
            where=f"port {port}",
            remedy="give two blocks whose ground points are to be compared",
        )
    xyz_m = np.where(ground.role[rows] != NO_ROLE, ground.xyz_m[rows], np.nan)
    n, place = len(rows), np.full(len(ground), -1)
    place[rows] = np.arange(n)
    C = np.zeros((n, 3, n, 3))
    C[np.arange(n), :, np.arange(n)] = ground.covariance_m2[rows]
    c = block.ground_point_covariances
    a, b = place[c.row_a], place[c.row_b]
    kept = (a >= 0) & (b >= 0)
    a, b, i, j, value = a[kept], b[kept], c.axis_a[kept], c.axis_b[kept], c.value[kept]
    C[a, i, b, j] = value
    C[b, j, a, i] = value
    return EpochPoints(block.points.id[ground.point[rows]], xyz_m, C)


def marked_epochs(points: EpochPoints, marks: tuple[str, str]) -> tuple[EpochPoints, EpochPoints, Float]:
    """Points of one adjustment by the mark at the end of their ids, and the covariance between both epochs.

    Raises
    ------
    InputError
        If a mark is nowhere.
    """
    epochs, rows_of = [], []
    for mark in marks:
        rows = np.flatnonzero(np.char.endswith(points.id, mark))
        if not len(rows):
            raise InputError(
                f"no point has an id that ends with {mark!r}",
                where="options of epochs/congruence: marks",
                remedy="give the later epoch by `solution` and the earlier one by `earlier`, or mark ids: P7@1, P7@2",
            )
        own = points.take(rows)
        ids = np.array([name.removesuffix(mark) for name in own.id.tolist()])
        epochs.append(EpochPoints(ids, own.xyz_m, own.covariance_m2))
        rows_of.append(rows)
    return epochs[0], epochs[1], points.covariance_m2[rows_of[0]][:, :, rows_of[1]]
