"""Observed positions of projection centres or antennas (GNSS).

    v = D (X0 + R a - X_observed) + s + (t - t_mean) d + u dt
    dv/dX0 = D,   dv/dd = -D [R a]x,   dv/da = D R,   dv/d(dt) = u

D turns the residual into the axes of the block where the adjustment has other ones; positions given in part, such as
heights of a statoscope, are compared in its coordinates (`given_coordinates`). a is the lever arm, antenna minus
projection centre in the axes of the camera; zero where the projection centre itself was observed. Coordinates of
variance zero are exact: constraints, whatever the arm. The arm is unknown where the block says so (`carried_vectors`),
shift s and drift of a group, of the block, of a strip or of a flight (`drift`) run along the axes of the block, and dt
is estimated where the options say so (`carried_vectors`). Source: docs/formulas.md 5.2, 5.3.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import Field

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State
from aatri.adjustment.whitening import whitener_of_covariances
from aatri.arrays import Bool, Float, Int, Text
from aatri.codes import ANTENNA, OBSERVED_VALUE
from aatri.errors import InputError
from aatri.geometry.rotations import skew
from aatri.ids import shown
from aatri.observations.carried_vectors import ARMS, LEVER_ARM, offset_unknowns, velocities
from aatri.observations.drift import DRIFT, SharedUnknowns, drift_term, group_times, observed_with_terms, time_notes
from aatri.observations.given_coordinates import GivenCoordinates, given_coordinates, in_own_axes
from aatri.observations.observed import ObservationSource, Observed
from aatri.observations.parameters import uses_of_vector
from aatri.observations.poses import POSE, Poses
from aatri.options import Options

if TYPE_CHECKING:
    from aatri.artifacts.block import Block

KIND = "position"

USES = ("exterior.position_m", "cameras.lever_arm_m", "exterior.drift_group", *uses_of_vector(ARMS.name))


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
    """Observed positions of projection centres or antennas."""

    row: Int
    """(n,) int32. Row in the Block's exterior."""
    image: Int
    """(n,) int32. Row in images."""
    position_m: Float
    """(n, 3), m. NaN where not given."""
    covariance_m2: Float
    """(n, 3, 3), m^2. A zero variance means exact."""
    lever_arm_m: Float
    """(n, 3), m, camera axes. Zero where the projection centre itself was observed."""

    @property
    def given(self) -> Bool:
        """Coordinates that are observed or exact, (n, 3)."""
        return np.isfinite(self.position_m)

    @property
    def exact(self) -> Bool:
        """Coordinates that are exact, (n, 3)."""
        return np.asarray(self.given & (np.einsum("nii->ni", self.covariance_m2) == 0))

    def take(self, rows: Int | Bool) -> Positions:
        """The chosen positions."""
        return Positions(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    def by_exactness(self) -> Iterator[tuple[bool, Int]]:
        """False with the rows that have weighted coordinates, True with those that have exact ones, where there are."""
        for exact, components in ((False, self.given & ~self.exact), (True, self.exact)):
            rows = np.flatnonzero(components.any(axis=1))
            if len(rows):
                yield exact, rows


def positions_of(block: Block) -> Positions:
    """Observed positions of a block, in the order of its exterior table."""
    exterior = block.exterior
    is_observed = np.isfinite(exterior.position_m).any(axis=1) & (exterior.position_use == OBSERVED_VALUE)
    row = np.flatnonzero(is_observed & block.images.active[exterior.image]).astype(np.int32)
    image = exterior.image[row]
    arm = block.cameras.lever_arm_m[block.images.camera[image]]
    arm = np.where((exterior.refers_to[row] == ANTENNA)[:, None], arm, 0.0)
    return Positions(row, image, exterior.position_m[row], exterior.position_covariance_m2[row], arm)


def positions(source: ObservationSource, options: PositionOptions) -> tuple[Observed, ...]:
    """Observed positions of the block, with the unknowns that they share."""
    block, rows = source.block, positions_of(source.block)
    if not options.use or not len(rows.row):
        return ()
    coordinates = given_coordinates(source, rows.position_m, rows.given)
    names, group = block.images.id[rows.image], drift_groups(block, rows, options)
    terms = _terms(block, rows, group, options)
    observed = observed_positions(rows, source.origin_m, names, coordinates, terms)
    drifting = next((k for k, o in enumerate(observed) if DRIFT in o.start), None)
    if options.drift == "linear" and drifting is not None:
        notes = time_notes(block.images, rows.image, group)
        observed = (*observed[:drifting], replace(observed[drifting], notes=notes), *observed[drifting + 1 :])
    if not any(t.unknowns.name == LEVER_ARM for t in terms):
        return observed
    return (*observed, *ARMS.priors(block, block.cameras.lever_arm_m, ARMS.unknowns(block)))


def _terms(block: Block, rows: Positions, group: Text, options: PositionOptions) -> list[SharedUnknowns]:
    """The unknowns of positions beside the poses: drift by groups, unknown lever arms, exposure-time offsets."""
    terms = []
    if (group != "").any():
        time = group_times(block.images.time_s[rows.image], block.images.sequence[rows.image], group)
        terms.append(drift_term(group, time, rows.given, linear=options.drift == "linear"))
    camera = block.images.camera[rows.image]
    armed = np.asarray(block.exterior.refers_to[rows.row] == ANTENNA)
    if armed.any():
        armed &= np.asarray(ARMS.open(block)[0].any(axis=1))[camera]
    if armed.any():
        terms.append(
            SharedUnknowns(ARMS.unknowns(block), block.cameras.lever_arm_m.copy(), np.where(armed, camera, -1))
        )
    if options.time_offset:
        u = velocities(block, rows.image, rows.position_m)
        terms.append(SharedUnknowns(offset_unknowns(block), np.zeros((len(block.cameras), 1)), camera, u[:, :, None]))
    return terms


def drift_groups(block: Block, rows: Positions, options: PositionOptions) -> Text:
    """Name of the group that shares shift and drift, (n,) str; empty where there is none.

    Raises
    ------
    InputError
        If an image has no strip or flight that it is to be grouped by.
    """
    n = len(rows.row)
    if options.drift == "none":
        return np.full(n, "")
    if options.per == "block":
        return np.full(n, "block")
    if options.per == "group":
        return block.exterior.drift_group[rows.row]
    images, strips = block.images, np.append(block.strips.id, "")
    group = strips[images.strip[rows.image]] if options.per == "strip" else images.flight[rows.image]
    without = images.id[rows.image[group == ""]]
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
    rows: Positions,
    origin_m: Float,
    names: Text,
    coordinates: GivenCoordinates | None = None,
    terms: Sequence[SharedUnknowns] = (),
) -> tuple[Observed, ...]:
    """Weighted and exact positions, given the names of their images, their coordinates in the adjustment, and terms."""
    own_axes = in_own_axes(rows.position_m, origin_m, rows.given) if coordinates is None else coordinates

    def records(chosen: Int, exact: bool, touched: Sequence[SharedUnknowns]) -> Records:
        arm = next((t.block.astype(np.int32) for t in touched if t.basis is None), None)
        return position_records(rows.take(chosen), own_axes.take(chosen), arm, exact=exact)

    return observed_with_terms(records, rows.by_exactness(), terms, rows.row, names, "m")


def position_records(
    rows: Positions, coordinates: GivenCoordinates, camera: Int | None = None, *, exact: bool
) -> Records:
    """Records of observed positions: of their weighted coordinates, or of their exact ones.

    `camera` is that of each, where its lever arm is unknown: they touch it, too.
    """

    def evaluate(state: State, chosen: Int) -> tuple[Float, tuple[Float, ...]]:
        poses: Poses = state[POSE]
        image = rows.image[chosen]
        R = poses.ground_from_image[image]
        own = rows.lever_arm_m[chosen] if camera is None else state[LEVER_ARM][camera[chosen]]
        arm = np.einsum("nij,nj->ni", R, own)
        v, D = coordinates.residuals(poses.position_m[image] + arm, chosen)
        by_pose = np.concatenate([D, -D @ skew(arm)], axis=2)
        return v, (by_pose,) if camera is None else (by_pose, D @ R)

    weighted = whitener_of_covariances(rows.covariance_m2, rows.given & ~rows.exact)
    whitener = np.where(rows.exact, 1.0, 0.0) if exact else weighted
    touches = ((POSE, rows.image), *(() if camera is None else ((LEVER_ARM, camera),)))
    return Records(KIND, touches, evaluate, whitener, np.ones(len(rows.row), dtype=bool))
