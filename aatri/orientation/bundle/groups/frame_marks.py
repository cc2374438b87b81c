"""Marks of portable frames, each as what may be wrong with the distances of its frame.

A mark that was measured e off where it is makes its distances wrong by d(X + e) - d(X), and no others:

    v + H p,    H = dd/dX U at X + e / 2,    p = U' e

U are the directions that its distances see: all three, in a board those within it. At the middle of both places H p is
right to third order in e; e is what the distances of the mark ask for, the other marks held. A frame without a mark is
one in which p is free, whatever the distances are that were chosen for it.
"""

from collections.abc import Iterator

import numpy as np

from aatri.adjustment.unknowns import State
from aatri.arrays import Float, Int
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.groups.candidates import MARK, Candidates, Cause
from aatri.orientation.bundle.result import BundleResult

HARDLY_SEEN = 1e-3
"""Singular value, as a share of the largest, of a direction in which distances hardly see a mark: it stays there."""

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
