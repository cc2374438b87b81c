"""Observed positions of projection centres or antennas (GNSS).

    v = D (X0 + R a - X_observed),    dv/dX0 = D,    dv/dd = -D [R a]x

D turns the residual into the axes of the block where the adjustment has other ones (`Given.placed`); else it is I.
a is the lever arm, antenna minus projection centre in the axes of the camera; zero where the projection centre itself
was observed. Positions with unknowns of their own (shift and drift, unknown lever arm, exposure time): see `drift`.
Source: docs/formulas.md 5.2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import Field

from aatri.adjustment.records import Records, whitener_of_covariances
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int, Text
from aatri.codes import ANTENNA, OBSERVED_VALUE
from aatri.errors import InputError
from aatri.geometry.rotations import skew
from aatri.ids import shown
from aatri.observations.lever_arms import open_arms
from aatri.observations.observed import Given, Observed, named
from aatri.observations.poses import POSE, Poses
from aatri.options import Options

if TYPE_CHECKING:
    from aatri.artifacts.block import Block

KIND = "position"

USES = ("exterior.position_m", "cameras.lever_arm_m")


class PositionOptions(Options):
    """Options of observed positions."""

    use: bool = Field(True, description="use observed positions of the projection centres")
    drift: Literal["none", "shift", "linear"] = Field(
        "linear", description="what positions of a group share: nothing, a shift, or a shift and a linear drift"
    )
    per: Literal["group", "block", "strip", "flight"] = Field(
        "group", description="what is a group: column drift_group of exterior.csv, all positions, a strip, a flight"
    )
    time_offset: bool = Field(False, description="an exposure-time offset for each camera, times the velocity")


@dataclass(frozen=True)
class Positions:
    """Observed positions of projection centres or antennas.

    Attributes
    ----------
    row : (n,) int32
        Row in the Block's exterior.
    image : (n,) int32
        Row in images.
    position_m : (n, 3) float64, m
    covariance_m2 : (n, 3, 3) float64, m^2
    lever_arm_m : (n, 3) float64, m, camera axes
        Zero where the projection centre itself was observed.
    """

    row: Int
    image: Int
    position_m: Float
    covariance_m2: Float
    lever_arm_m: Float


def positions_of(block: Block) -> Positions:
    """Observed positions of a block, in the order of its exterior table."""
    exterior = block.exterior
    known = np.isfinite(exterior.position_m).all(axis=1) & (exterior.position_use == OBSERVED_VALUE)
    row = np.flatnonzero(known & block.images.active[exterior.image]).astype(np.int32)
    image = exterior.image[row]
    arm = block.cameras.lever_arm_m[block.images.camera[image]]
    arm = np.where((exterior.refers_to[row] == ANTENNA)[:, None], arm, 0.0)
    return Positions(row, image, exterior.position_m[row], exterior.position_covariance_m2[row], arm)


def positions(given: Given, options: PositionOptions) -> tuple[Observed, ...]:
    """Observed positions of the block that have no unknowns of their own."""
    found = positions_of(given.block)
    if not options.use:
        return ()
    alone = np.flatnonzero(~with_unknowns(given.block, found, options))
    found = taken(found, alone)
    found, derivatives = placed(given, found)
    return observed_positions(found, given.origin_m, given.block.images.id[found.image], derivatives)


def placed(given: Given, rows: Positions) -> tuple[Positions, Float]:
    """Positions in the frame of the adjustment, and D of each."""
    position_m, derivatives = given.placed(rows.position_m)
    return replace(rows, position_m=position_m), derivatives


def with_unknowns(block: Block, found: Positions, options: PositionOptions) -> Bool:
    """Which positions have a drift, an unknown lever arm or an exposure-time offset, (n,)."""
    if options.time_offset:
        return np.ones(len(found.row), dtype=bool)
    armed = np.asarray(open_arms(block)[0].any(axis=1))[block.images.camera[found.image]]
    armed &= block.exterior.refers_to[found.row] == ANTENNA
    return np.asarray(armed | (drift_groups(block, found, options) != ""))


def drift_groups(block: Block, found: Positions, options: PositionOptions) -> Text:
    """Name of the group that shares shift and drift, (n,) str; empty where there is none.

    Raises
    ------
    InputError
        If an image has no strip or flight that it is to be grouped by.
    """
    n = len(found.row)
    if options.drift == "none":
        return np.full(n, "")
    if options.per == "block":
        return np.full(n, "block")
    if options.per == "group":
        return block.exterior.drift_group[found.row]
    images, strips = block.images, np.append(block.strips.id, "")
    group = strips[images.strip[found.image]] if options.per == "strip" else images.flight[found.image]
    without = images.id[found.image[group == ""]]
    if len(without):
        raise InputError(
            f"positions.per: {options.per}, but images {shown(without.tolist())} have no {options.per}",
            remedy=f"give `{options.per}` in images.csv, or another `per`",
        )
    return np.asarray(group)


def uses_positions(block: Block, options: object) -> bool:
    """Whether a stage with these options uses observed positions."""
    chosen: PositionOptions = options.positions  # type: ignore[attr-defined]
    return chosen.use and len(positions_of(block).row) > 0


def taken(rows: Positions, some: Int) -> Positions:
    """The chosen positions."""
    return Positions(
        rows.row[some], rows.image[some], rows.position_m[some], rows.covariance_m2[some], rows.lever_arm_m[some]
    )


def observed_positions(
    rows: Positions, origin_m: Float, names: Text, derivatives: Float | None = None
) -> tuple[Observed, ...]:
    """Observed positions, given the names of their images; none if there are none."""
    if not len(rows.row):
        return ()
    records = position_records(
        rows.image, rows.position_m - origin_m, rows.covariance_m2, rows.lever_arm_m, derivatives
    )
    return (Observed(records, rows.row, named(image=names), "m"),)


def position_records(
    image: Int, position_m: Float, covariance_m2: Float, lever_arm_m: Float, derivatives: Float | None = None
) -> Records:
    """Records of observed positions.

    Parameters
    ----------
    image : (n,) int32
    position_m : (n, 3) float64, m
    covariance_m2 : (n, 3, 3) float64, m^2
    lever_arm_m : (n, 3) float64, m, camera axes
    derivatives : (n, 3, 3) float64, optional
        D of each; default I.
    """
    D = np.broadcast_to(np.eye(3), (len(image), 3, 3)) if derivatives is None else derivatives

    def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        poses: Poses = state[POSE]
        arm = np.einsum("nij,nj->ni", poses.ground_from_image[image[rows]], lever_arm_m[rows])
        v = poses.position_m[image[rows]] + arm - position_m[rows]
        by_pose = np.concatenate([D[rows], -D[rows] @ skew(arm)], axis=2)
        return np.einsum("nij,nj->ni", D[rows], v), (by_pose,)

    active = np.ones(len(image), dtype=bool)
    return Records(KIND, ((POSE, image),), evaluate, whitener_of_covariances(covariance_m2), active)
