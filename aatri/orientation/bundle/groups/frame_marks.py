"""Points of one record, each as what may be wrong with it: marks of portable frames, control with full covariances.

A mark that was measured e off where it is makes its distances wrong by d(X + e) - d(X), and no others:

    v + H p,    H = dd/dX U at X + e / 2,    p = U' e

U are the directions that its distances see: all three, in a board those within it. At the middle of both places H p is
right to third order in e; e is what the distances of the mark ask for, the other marks held. A frame without a mark is
one in which p is free, whatever the distances are that were chosen for it.

Of control with full covariances H are the columns of the identity that belong to the coordinates of a point: with p
free all others have the covariance that they have without the point. Points that an earlier stage has rejected begin
so: where they fit after all, p is not significant in the end.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from aatri.adjustment.unknowns import State
from aatri.arrays import Float, Int
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT
from aatri.orientation.bundle.block import BundleInput, start_of
from aatri.orientation.bundle.groups.candidates import MARK, Candidates, Cause
from aatri.orientation.bundle.groups.group import Group
from aatri.orientation.bundle.groups.limits import HARDLY_SEEN
from aatri.orientation.bundle.result import BundleResult

COORDINATES = "coordinates"
"""What may be wrong with a control point."""

SETS_OUT = "control with full covariances takes no part: without the points rejected before it has no solution"
"""Of control of which points cannot be left out alone."""

PASSES = 3
"""Gauss-Newton steps to where the distances have a mark."""


def marks_of_frames(block: BundleInput, result: BundleResult, place: int, rows: Int) -> Iterator[Candidates]:
    """Candidates of all marks that two distances of their frame see, frame by frame."""
    o = block.observed[place]  # without marks that the result has free already
    if any(group != POINT for group, _ in o.records.touches):
        return
    for row in rows.tolist():
        marks, effects = _effects(o, result.adjusted.state, row)
        if len(marks):
            rows_of_frame, cause = np.full(len(marks), row), Cause("place in its frame", tuple(range(effects.shape[2])))
            ids = np.asarray(block.point_ids)[marks]
            yield Candidates(place, MARK, ids, rows_of_frame, np.arange(len(marks)), effects, (cause,))


def gives_coordinates(o: Observed) -> bool:
    """Whether these are sets of points, of whose coordinates the covariances are known together."""
    points = [blocks for group, blocks in o.records.touches if group == POINT]
    return (
        bool(o.components) and o.set_rows is not None and 3 * o.set_rows.shape[1] == o.records.rows == 3 * len(points)
    )


def points_of_sets(block: BundleInput, state: State, place: int, rows: Int) -> Iterator[Candidates]:
    """Candidates of all control points with full covariances, set by set, those with as many coordinates together."""
    o, ids = block.observed[place], np.asarray(block.point_ids)
    for row in rows.tolist():
        points, effects = _coordinates(o, state, row)
        for k in sorted({H.shape[1] for H in effects}):
            of_size = [j for j, H in enumerate(effects) if H.shape[1] == k]
            rows_of_set, units = np.full(len(of_size), row), np.arange(len(of_size))
            causes = (Cause(COORDINATES, tuple(range(k))),)
            H = np.array([effects[j] for j in of_size])
            yield Candidates(place, MARK, ids[points[of_size]], rows_of_set, units, H, causes)


def rejected_points_of_sets(block: BundleInput) -> list[Group]:
    """Control points with full covariances that an earlier stage has rejected, as groups that begin at zero."""
    groups = list[Group]()
    for place, o in enumerate(block.observed):
        if o.rejected_in_set is None or not o.rejected_in_set.any() or not gives_coordinates(o):
            continue
        for row in np.flatnonzero(o.rejected_in_set.any(axis=1)).tolist():
            points, effects = _coordinates(o, start_of(block), row)
            for j in np.flatnonzero(o.rejected_in_set[row]).tolist():
                H, unit, k = effects[j][None], str(block.point_ids[points[j]]), effects[j].shape[1]
                begin = (np.zeros(k), np.ones(k))
                groups.append(Group(place, o.kind, MARK, unit, COORDINATES, np.array([row]), H, *begin, 0.0, 1.0))
    return groups


def without_rejected_sets(observed: Sequence[Observed]) -> tuple[Observed, ...]:
    """Observations without the control with full covariances of which an earlier stage has rejected a point."""
    return tuple(
        o
        if o.rejected_in_set is None or not gives_coordinates(o)
        else o.without(np.asarray(o.rejected_in_set.any(axis=1)))
        for o in observed
    )


def _coordinates(o: Observed, state: State, row: int) -> tuple[Int, list[Float]]:
    """Points of a set, (u,), and for each the columns of its observed coordinates, (m, k)."""
    points = np.array([points[row] for group, points in o.records.touches if group == POINT], dtype=np.int64)
    jacobians, used = o.records.evaluate(state, np.array([row]))[1], o.records.observed_components()[row]
    columns = np.eye(o.records.rows)
    return points, [columns[:, used & J[0].any(axis=1)] for J in jacobians[: len(points)]]


def _effects(o: Observed, state: State, row: int) -> tuple[Int, Float]:
    """Marks of a frame with two distances and more, (u,), and their H, (u, m, k)."""
    marks = np.array([points[row] for _, points in o.records.touches], dtype=np.int64)
    solid = len(marks) > 3 and o.records.rows >= 3 * len(marks) - 6
    tested, effects = [], []
    for j, mark in enumerate(marks if np.isfinite(state[POINT][marks]).all() else ()):
        X, at = np.array(state[POINT]), state[POINT][mark]
        own = _derivatives(o, state, X, row, j)[1].any(axis=1)
        if own.sum() < 2:
            continue
        for _ in range(PASSES):
            v, J = _derivatives(o, state, X, row, j)
            X[mark] -= np.linalg.pinv(J[own], rcond=HARDLY_SEEN) @ v[own]
        X[mark] = 0.5 * (at + X[mark])
        J = _derivatives(o, state, X, row, j)[1]
        tested.append(mark)
        effects.append(J if solid else J @ _within(np.linalg.svd(J)[2][2]))
    return np.array(tested, dtype=np.int64), np.array(effects)


def _within(normal: Float) -> Float:
    """Two orthonormal directions across a normal, (3, 2): the axes that are nearest to it, whatever its sign."""
    axes = np.delete(np.eye(3), np.argmax(np.abs(normal)), axis=1)
    directions = np.linalg.qr(axes - np.outer(normal, normal @ axes))[0]
    return np.asarray(directions)


def _derivatives(o: Observed, state: State, X: Float, row: int, mark: int) -> tuple[Float, Float]:
    """Residuals of a frame with its marks at X, (m,), and their derivatives by one of them, (m, 3)."""
    v, jacobians = o.records.evaluate({**state, POINT: X}, np.array([row]))
    return v[0], jacobians[mark][0]
