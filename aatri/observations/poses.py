"""Poses: the orientations of images as a group of unknowns.

A block is (X0, Y0, Z0, d1, d2, d3): the projection centre and the rotation increment on the ground side,
R <- exp([d]x) R. How a finite step moves an image is a choice, as long as small ones are the same: see `retract_poses`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import Ids, State, Unknowns
from aatri.arrays import Bool, Float, Int, finite_rows
from aatri.geometry.rotations import exp_rotation, skew
from aatri.geometry.similarity import UNKNOWNS, motions
from aatri.observations.limits import GOES_WITH, NO_TURN_RAD

POSE = "image"
POINT = "point"
FILM = "film"
FILM_PRIOR = f"{FILM}_prior"
ADDITIONAL = "additional"
CAMERA = "camera"
"""Names of the groups of unknowns."""


def is_additional(group: str) -> bool:
    """Whether a group has additional parameters: all of a set, or the part that its cameras, images ... share."""
    return group == ADDITIONAL or group.startswith(f"{ADDITIONAL} per ")


@dataclass(frozen=True)
class Poses:
    """Orientations of n images."""

    position_m: Float
    """(n, 3), m."""
    ground_from_image: Float
    """(n, 3, 3)."""

    @property
    def oriented(self) -> Bool:
        """Images with a position and a rotation: a position alone, from GNSS, lets no point be intersected."""
        return finite_rows(self.position_m) & finite_rows(self.ground_from_image)

    def where(self, these: Bool, others: Poses | None = None) -> Poses:
        """These for some of the images, (n,); for the rest the others, or NaN."""
        position, rotation = (np.nan, np.nan) if others is None else (others.position_m, others.ground_from_image)
        return Poses(
            np.where(these[:, None], self.position_m, position),
            np.where(these[:, None, None], self.ground_from_image, rotation),
        )

    def shifted(self, by_m: Float) -> Poses:
        """The same, all positions shifted."""
        return Poses(self.position_m + by_m, self.ground_from_image)


def position(state: State, group: str) -> Float:
    """Positions of points or projection centres."""
    values: Any = state[group].position_m if group == POSE else state[group]
    return np.asarray(values)


def by_unknowns(group: str, by_position: Float) -> Float:
    """Derivatives by the unknowns of an end, (n, m, 3) or (n, m, 6): a place does not tell how an image is turned."""
    if group == POINT:
        return by_position
    return np.concatenate([by_position, np.zeros_like(by_position)], axis=2)


def pose_generator(state: State, rows: Int | slice = slice(None)) -> Float:
    """Shifts, rotations about the origin and scale of all poses or some, (n, 6, 7)."""
    x: Float = state[POSE].position_m[rows]
    moves = np.zeros((len(x), 6, 7))
    moves[:, :3] = motions(x)
    moves[:, 3:, 3:6] = np.eye(3)
    return moves


def point_generator(state: State, rows: Int | slice = slice(None)) -> Float:
    """The same of ground points, (n, 3, 7)."""
    return motions(state[POINT][rows])


GENERATORS = {POSE: pose_generator, POINT: point_generator}
"""How a similarity moves poses and ground points, by group."""


def by_similarity(records: Records, rows: Int, jacobians: tuple[Float, ...], state: State) -> Float:
    """Derivatives of some records by shift, rotation and scale of all poses and points, (n, m, 7).

    Parameters
    ----------
    jacobians : tuple of (n, m, s) float64
        Of these rows, one for each touched group; groups other than poses and points stay.
    """
    touching = zip(records.touches, jacobians)
    parts = [J @ GENERATORS[group](state, block[rows]) for (group, block), J in touching if group in GENERATORS]
    return np.asarray(sum(parts, np.zeros((len(rows), records.rows, UNKNOWNS))))


@dataclass(frozen=True)
class CommonTurn:
    """What of a step turns the whole block, done as a finite turn: along tangents rays would leave each other.

    A weak datum lets a block turn by many degrees at a step. Centres and points X move by t x X to first order; with

        X <- X + dX + (exp([t]x) - 1 - [t]x) (X - X_m)       t: mean turn of the images, X_m: mean of their centres

    the rays keep to each other, and one step goes as far as many short ones. Where the points do not go with the images
    (most of them by less than half of t, or more than half too far) there is no common turn, and nothing is changed.
    """

    free: Mapping[str, Bool]
    """Free scalars of poses (n, 6) and points (m, 3)."""

    def __call__(self, before: State, after: State, step: Mapping[str, Float]) -> dict[str, Any]:
        """The state after a step of poses and points that retracts each by itself."""
        images, points = (self.free[group].all(axis=1) for group in (POSE, POINT))
        if not images.any() or not points.any():
            return dict(after)
        t = step[POSE][images, 3:].mean(axis=0)
        if np.linalg.norm(t) < NO_TURN_RAD:
            return dict(after)
        x, dx = (v[points] - np.median(v[points], axis=0) for v in (before[POINT], step[POINT]))
        turned = np.cross(t, x)
        share = np.median((dx * turned).sum(axis=1) / np.maximum((turned**2).sum(axis=1), np.finfo(float).tiny))
        if not abs(share - 1.0) < GOES_WITH:
            return dict(after)
        bend = exp_rotation(t) - np.eye(3) - skew(t)
        middle = before[POSE].position_m[images].mean(axis=0)

        def bent(group: str) -> Float:
            off = (position(before, group) - middle) @ bend.T
            return np.asarray(position(after, group) + np.where(self.free[group][:, :3], off, 0.0))

        return {**after, POSE: Poses(bent(POSE), after[POSE].ground_from_image), POINT: bent(POINT)}


def retract_poses(poses: Poses, step: Float, seen_at_m: Float | None = None) -> Poses:
    """Poses after a step s of the projection centre and d of the rotation: about the centre, or what the image sees.

    An image that only its points hold keeps to the place X0 + D a where it looks, a = -R e3, while it turns and its
    distance D changes with that of its points and with the principal distance. With a' = exp([d]x) a,

        X0 <- X0 + s + D d x a - (D - s'a) (a' - a)

    which is X0 + s to first order: the linearised equations are the same, and steps a hundred times as long hold.

    Parameters
    ----------
    step : (n, 6) float64
    seen_at_m : (n,) float64, m, optional
        About D, of what each image sees; 0: it turns about its projection centre, X0 <- X0 + s.
    """
    s, d = step[:, :3], step[:, 3:]
    rotation = exp_rotation(d) @ poses.ground_from_image
    position = poses.position_m + s
    if seen_at_m is not None and seen_at_m.any():
        D, a = seen_at_m[:, None], -poses.ground_from_image[:, :, 2]
        after = np.where(D > 0, np.maximum(D - (s * a).sum(axis=1, keepdims=True), 0.0), 0.0)
        position = position + D * np.cross(d, a) - after * (-rotation[:, :, 2] - a)
    return Poses(position, rotation)


def pose_unknowns(
    ids: Ids, free: Bool, position_m: Float, distance_m: float | None = None, seen_at_m: Float | None = None
) -> Unknowns:
    """The group of poses.

    Parameters
    ----------
    ids : (n,) str
    free : (n, 6) bool
    position_m : (n, 3) float64, m
        Where images lie, for the order of elimination.
    distance_m : float, optional, m
        Of the ground: a centre less certain than this, or a rotation than 1 rad, is not determined.
    seen_at_m : (n,) float64, optional, m
        See `retract_poses`; only where all six scalars are free.
    """
    labels = ("X0", "Y0", "Z0", "rotation about X", "rotation about Y", "rotation about Z")
    seen_at_m = None if seen_at_m is None else np.where(free.all(axis=1), seen_at_m, 0.0)
    retract = partial(retract_poses, seen_at_m=seen_at_m)
    return Unknowns(
        POSE,
        free,
        labels,
        ids,
        retract,
        position=position_m[:, :2],
        generator=pose_generator,
        implausible=None if distance_m is None else np.array([distance_m] * 3 + [1.0] * 3),
    )
