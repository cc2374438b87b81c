"""Observed positions of projection centres or antennas (GNSS).

    v = D (X0 + R a - X_observed),    dv/dX0 = D,    dv/dd = -D [R a]x

D turns the residual into the axes of the block where the adjustment has other ones; positions given in part, such as
heights of a statoscope, are compared in its coordinates (`given_coordinates`). a is the lever arm, antenna minus
projection centre in the axes of the camera; zero where the projection centre itself was observed. Coordinates of
variance zero are exact: constraints, whatever the arm. Positions with unknowns of their own (shift and drift, unknown
lever arm, exposure time): see `drift`.
Source: docs/formulas.md 5.2.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
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
from aatri.observations.carried_vectors import ARMS
from aatri.observations.given_coordinates import GivenCoordinates, given_coordinates, in_own_axes
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
        NaN where not given.
    covariance_m2 : (n, 3, 3) float64, m^2
        A zero variance means exact.
    lever_arm_m : (n, 3) float64, m, camera axes
        Zero where the projection centre itself was observed.
    """

    row: Int
    image: Int
    position_m: Float
    covariance_m2: Float
    lever_arm_m: Float

    @property
    def given(self) -> Bool:
        """Coordinates that are observed or exact, (n, 3)."""
        return np.isfinite(self.position_m)

    @property
    def exact(self) -> Bool:
        """Coordinates that are exact, (n, 3)."""
        return np.asarray(self.given & (np.einsum("nii->ni", self.covariance_m2) == 0))

    def take(self, some: Int | Bool) -> Positions:
        """The chosen positions."""
        return Positions(*(getattr(self, name)[some] for name in self.__dataclass_fields__))

    def by_exactness(self) -> Iterator[tuple[bool, Int]]:
        """False with the rows that have weighted coordinates, True with those that have exact ones, where there are."""
        for exact, components in ((False, self.given & ~self.exact), (True, self.exact)):
            rows = np.flatnonzero(components.any(axis=1))
            if len(rows):
                yield exact, rows


def positions_of(block: Block) -> Positions:
    """Observed positions of a block, in the order of its exterior table."""
    exterior = block.exterior
    known = np.isfinite(exterior.position_m).any(axis=1) & (exterior.position_use == OBSERVED_VALUE)
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
    found = found.take(~with_unknowns(given.block, found, options))
    coordinates = given_coordinates(given, found.position_m, found.given)
    return observed_positions(found, given.origin_m, given.block.images.id[found.image], coordinates)


def with_unknowns(block: Block, found: Positions, options: PositionOptions) -> Bool:
    """Which positions have a drift, an unknown lever arm or an exposure-time offset, (n,)."""
    if options.time_offset:
        return np.ones(len(found.row), dtype=bool)
    armed = np.asarray(ARMS.open(block)[0].any(axis=1))[block.images.camera[found.image]]
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


def uses_positions(block: Block, options: PositionOptions) -> bool:
    """Whether a stage with these options uses observed positions."""
    return options.use and len(positions_of(block).row) > 0


def observed_positions(
    rows: Positions, origin_m: Float, names: Text, coordinates: GivenCoordinates | None = None
) -> tuple[Observed, ...]:
    """Weighted and exact positions, given the names of their images and their coordinates in the adjustment."""
    given = in_own_axes(rows.position_m, origin_m, rows.given) if coordinates is None else coordinates
    return tuple(
        Observed(
            position_records(rows.take(some), given.take(some), exact=exact),
            rows.row[some],
            named(image=names[some]),
            "m",
            exact=exact,
        )
        for exact, some in rows.by_exactness()
    )


def position_records(rows: Positions, coordinates: GivenCoordinates, *, exact: bool) -> Records:
    """Records of observed positions: of their weighted coordinates, or of their exact ones."""

    def evaluate(state: State, some: Int) -> tuple[Float, tuple[Float, ...]]:
        poses: Poses = state[POSE]
        image = rows.image[some]
        arm = np.einsum("nij,nj->ni", poses.ground_from_image[image], rows.lever_arm_m[some])
        v, D = coordinates.residuals(poses.position_m[image] + arm, some)
        return v, (np.concatenate([D, -D @ skew(arm)], axis=2),)

    weighted = whitener_of_covariances(rows.covariance_m2, rows.given & ~rows.exact)
    whitener = np.where(rows.exact, 1.0, 0.0) if exact else weighted
    return Records(KIND, ((POSE, rows.image),), evaluate, whitener, np.ones(len(rows.row), dtype=bool))
