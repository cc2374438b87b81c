"""A free component brought to the ground by observations of any kind, as one body with seven unknowns.

    X = T + s R x,   X0 = T + s R x0,   R_image = R R_image'        T, s, R from all records of the points and images,

with the unknowns that kinds bring along (orientations of sets, planes, plumb lines) beside them. A step (t, r, m) of
shift, rotation and scale moves the body by the generators of a similarity, so that the derivatives of a record are
those to its images and points times these:

    dv = sum J_b G_b (t, r, m),      T <- (1 + m) E T + t,   R <- E R,   s <- (1 + m) s,   E = exp([r]x)

Starts are levelled by the viewing direction and turned through all headings, with scale and shift by linear least
squares; that of least cost counts. What the observations leave open is an error that names it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from aatri.adjustment.records import Records, whitened
from aatri.adjustment.stepping.adjust import adjust_large
from aatri.adjustment.unknowns import State, Unknowns
from aatri.arrays import Float, Int
from aatri.errors import ConvergenceError, GeometryError
from aatri.geometry.rotations import exp_rotation, levelling
from aatri.geometry.similarity import Similarity, transform
from aatri.geometry.vectors import finite_rows
from aatri.observations.image_points import KIND as IMAGE_POINT
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT, POSE, Poses, point_generator, pose_generator

BODY = "the component"
"""Name of the group of the seven unknowns."""

LABELS = ("shift X", "shift Y", "shift Z", "rotation about X", "rotation about Y", "rotation about Z", "scale")

HEADINGS = 12
"""Starts: every 30 degrees one."""

LINEAR_STEPS = 3
"""Steps of shift and scale, in which distances are nearly linear."""

SMALLEST = 0.1
"""A step reduces the scale to no less than this share."""

ITERATIONS, TOLERANCE = 60, 0.1

UPWARDS = 0.7
"""Sine of the elevation above which images look upwards: such an end counts only where there is no other."""

Observe = Callable[[Poses, Float], tuple[Observed, ...]]
"""(poses, points) on the ground -> the observations of them, of all kinds."""


def brought_to_ground(observe: Observe, poses: Poses, xyz: Float, up: Float) -> Similarity:
    """The similarity that brings a component to the ground.

    Parameters
    ----------
    observe : callable
    poses, xyz
        Of the component; NaN where it has none.
    up : (3,) float64
        Direction against the mean viewing direction, in the component.

    Raises
    ------
    GeometryError
        If something of the seven is left open.
    ConvergenceError
    """
    failure: GeometryError | ConvergenceError | None = None
    ends: list[tuple[bool, float, Similarity]] = []
    for turn in np.arange(HEADINGS) * 2 * np.pi / HEADINGS:
        rotation = exp_rotation(np.array([0.0, 0.0, turn])) @ levelling(up)
        try:
            found, cost = _adjusted(observe, poses, xyz, Similarity(np.zeros(3), 1.0, rotation))
        except (ConvergenceError, GeometryError) as error:
            failure = failure or error
            continue
        ends.append(((found.rotation @ up)[2] < -UPWARDS * np.linalg.norm(up), cost, found))
    if not ends:
        raise failure or GeometryError("nothing is observed of it", remedy="give control or observed positions")
    return min(ends, key=lambda end: end[:2])[2]


def _adjusted(observe: Observe, poses: Poses, xyz: Float, start: Similarity) -> tuple[Similarity, float]:
    first = _scaled(observe(*_moved(poses, xyz, start)), poses, xyz, start)
    observed = [o for o in observe(*_moved(poses, xyz, first)) if o.kind != IMAGE_POINT and len(o)]
    own = {name: value for o in observed for name, value in o.start.items()}
    records, constraints = list[Records](), list[Records]()
    for o in observed:
        rows = _of_component(o.records, poses, xyz)
        if len(rows):
            record = replace(_of_body(o.records.take(rows), poses, xyz), label=o.records.take(rows).label)
            (constraints if o.exact else records).append(record)
    unknowns = [Unknowns(BODY, np.ones((1, 7), dtype=bool), LABELS, ("as a whole",), _retracted)]
    unknowns += [replace(u, generator=None) for o in observed for u in o.unknowns]
    done = adjust_large(
        unknowns, records, {**own, BODY: first}, constraints=constraints, max_iterations=ITERATIONS, tolerance=TOLERANCE
    )
    return done.state[BODY], done.cost


def _moved(poses: Poses, xyz: Float, to: Similarity) -> tuple[Poses, Float]:
    return Poses(transform(to, poses.position_m), to.rotation @ poses.ground_from_image), transform(to, xyz)


def _retracted(value: Similarity, step: Float) -> Similarity:
    t, r, m = step[0, :3], step[0, 3:6], max(1.0 + float(step[0, 6]), SMALLEST)
    turn = exp_rotation(r)
    return Similarity(m * turn @ value.translation + t, m * value.scale, turn @ value.rotation)


def _of_component(records: Records, poses: Poses, xyz: Float) -> Int:
    """Rows that touch nothing but images and points of the component, and unknowns of their own."""
    known = {POSE: finite_rows(poses.position_m), POINT: finite_rows(xyz)}
    use = records.active.copy()
    for group, block in records.touches:
        use &= known[group][block] if group in known else True
    return np.flatnonzero(use)


def _of_body(records: Records, poses: Poses, xyz: Float) -> Records:
    """The same records, as observations of the body."""
    mine = [group in (POSE, POINT) for group, _ in records.touches]
    others = tuple(touch for touch, body in zip(records.touches, mine) if not body)

    def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        now = _state(state, poses, xyz)
        v, jacobians = records.evaluate(now, rows)
        moves = {POSE: pose_generator(now), POINT: point_generator(now)}
        J = np.sum(
            [
                J @ moves[group][block[rows]]
                for (group, block), J, body in zip(records.touches, jacobians, mine)
                if body
            ],
            axis=0,
        )
        return v, (J, *(J for J, body in zip(jacobians, mine) if not body))

    touches = ((BODY, np.zeros(len(records.active), dtype=np.int32)), *others)
    return Records(records.name, touches, evaluate, records.whitener, records.active)


def _state(state: State, poses: Poses, xyz: Float) -> dict[str, Any]:
    moved, ground = _moved(poses, xyz, state[BODY])
    return {**state, POSE: moved, POINT: ground}


def _scaled(observed: Iterable[Observed], poses: Poses, xyz: Float, start: Similarity) -> Similarity:
    """Shift and scale, the rotation held, from the observations without unknowns of their own."""
    plain = []
    for o in observed:
        rows = _of_component(o.records, poses, xyz)
        if o.kind != IMAGE_POINT and len(rows) and not o.exact and {g for g, _ in o.records.touches} <= {POSE, POINT}:
            plain.append(_of_body(o.records.take(rows), poses, xyz))
    for _ in range(LINEAR_STEPS if plain else 0):
        v, J = zip(
            *(
                (w.ravel(), A[0].reshape(-1, 7))
                for w, A in (whitened(r, {BODY: start}, np.arange(len(r.active))) for r in plain)
            )
        )
        used = [0, 1, 2, 6]
        step = np.zeros((1, 7))
        step[0, used] = -np.linalg.lstsq(np.concatenate(J)[:, used], np.concatenate(v), rcond=1e-9)[0]
        start = _retracted(start, step)
    return start
