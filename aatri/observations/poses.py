"""Poses: the orientations of images as a group of unknowns.

A block is (X0, Y0, Z0, d1, d2, d3): the projection centre and the rotation increment on the ground side,
R <- exp([d]x) R.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.adjustment.unknowns import Ids, State, Unknowns
from aatri.arrays import Bool, Float
from aatri.geometry.rotations import exp_rotation, skew

POSE = "image"
POINT = "point"
FILM = "film"
ADDITIONAL = "additional"
CAMERA = "camera"
"""Names of the groups of unknowns."""


def is_additional(group: str) -> bool:
    """Whether a group has additional parameters: all of a set, or the part that its cameras, images ... share."""
    return group == ADDITIONAL or group.startswith(f"{ADDITIONAL} per ")


@dataclass(frozen=True)
class Poses:
    """Orientations of n images.

    Attributes
    ----------
    position_m : (n, 3) float64, m
    ground_from_image : (n, 3, 3) float64
    """

    position_m: Float
    ground_from_image: Float


def pose_generator(state: State) -> Float:
    """Shifts, rotations about the origin and scale of all poses, (n, 6, 7)."""
    x: Float = state[POSE].position_m
    found = np.zeros((len(x), 6, 7))
    found[:, :3] = _similarity(x)
    found[:, 3:, 3:6] = np.eye(3)
    return found


def point_generator(state: State) -> Float:
    """The same of all ground points, (n, 3, 7)."""
    return _similarity(state[POINT])


def _similarity(x: Float) -> Float:
    shift = np.broadcast_to(np.eye(3), (len(x), 3, 3))
    return np.asarray(np.concatenate([shift, -skew(x), x[:, :, None]], axis=2))


def retract_poses(poses: Poses, step: Float) -> Poses:
    """Poses after a step (n, 6)."""
    rotation = exp_rotation(step[:, 3:]) @ poses.ground_from_image
    return Poses(poses.position_m + step[:, :3], rotation)


def pose_unknowns(ids: Ids, free: Bool, position_m: Float, distance_m: float | None = None) -> Unknowns:
    """The group of poses.

    Parameters
    ----------
    ids : (n,) str
    free : (n, 6) bool
    position_m : (n, 3) float64, m
        Where images lie, for the order of elimination.
    distance_m : float, optional, m
        Of the ground: a centre less certain than this, or a rotation than 1 rad, is not determined.
    """
    labels = ("X0", "Y0", "Z0", "rotation about X", "rotation about Y", "rotation about Z")
    return Unknowns(POSE, free, labels, ids, retract_poses, position=position_m[:, :2], generator=pose_generator,
                    implausible=None if distance_m is None else np.array([distance_m] * 3 + [1.0] * 3))  # fmt: skip
