"""Control points: given ground coordinates, each coordinate observed or exact.

    v = D (X - X_given),    dv/dX = D        or x(X) - x_given in plan or in height only, see `given_coordinates`

A coordinate of variance zero is exact: it is held at its value. Any other is an observation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State
from aatri.adjustment.whitening import whitener_of_covariances
from aatri.arrays import Bool, Float, Int, Text
from aatri.codes import CONTROL
from aatri.observations.correlated import joined
from aatri.observations.given_coordinates import GivenCoordinates, given_coordinates, in_own_axes
from aatri.observations.observed import NEARLY_EXACT, Holds, ObservationSource, Observed, named
from aatri.observations.poses import POINT

if TYPE_CHECKING:
    from aatri.artifacts.block import Block

KIND = "control"

PARTS = (("plan", (0, 1)), ("height", (2,)))
"""Components of control that are measured apart."""

USES = ("ground_points.xyz_m", "ground_points.covariance_m2", "ground_point_covariances")


@dataclass(frozen=True)
class Control:
    """Control points."""

    row: Int
    """(n,) int32. Row in the Block's ground_points."""
    point: Int
    """(n,) int32. Row in points."""
    xyz_m: Float
    """(n, 3), m."""
    covariance_m2: Float
    """(n, 3, 3), m^2."""
    observed: Bool
    """(n, 3). The coordinate is control, with a standard deviation."""
    exact: Bool
    """(n, 3). The coordinate is control and exact."""

    @property
    def given(self) -> Bool:
        """Coordinates that are control, (n, 3)."""
        return self.observed | self.exact

    def row_in_full(self, points: int) -> Int:
        """Row here of each of so many points, (points,); -1 of those that are not control in all coordinates."""
        row, full = np.full(points, -1), np.flatnonzero(self.given.all(axis=1))
        row[self.point[full]] = full
        return row

    def take(self, rows: Int) -> Control:
        """The chosen points."""
        return Control(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    def nearly_exact(self, exact: Bool) -> Float:
        """Covariances in which exact coordinates that are not held have a very small variance, (n, 3, 3)."""
        covariance = self.covariance_m2.copy()
        row, axis = np.nonzero(self.exact & ~exact)
        covariance[row, axis, axis] = NEARLY_EXACT**2
        return covariance


def known_at(point: Int, xyz_m: Float, covariance_m2: Float) -> Control:
    """Points observed in all coordinates that stand in no table; covariances are (n, 3, 3), or one of all."""
    none, all_ = np.full(len(point), -1, dtype=np.int32), np.ones((len(point), 3), dtype=bool)
    covariances_m2 = np.broadcast_to(covariance_m2, (len(point), 3, 3)).copy()
    return Control(none, point.astype(np.int32), xyz_m, covariances_m2, all_, ~all_)


def control_of(block: Block) -> Control:
    """Control points of a block, in the order of its ground_points."""
    ground = block.ground_points
    is_given = (ground.role == CONTROL) & np.isfinite(ground.xyz_m)
    row = np.flatnonzero(is_given.any(axis=1)).astype(np.int32)
    exact = np.einsum("nii->ni", ground.covariance_m2)[row] == 0
    return Control(
        row,
        ground.point[row],
        ground.xyz_m[row],
        ground.covariance_m2[row],
        is_given[row] & ~exact,
        is_given[row] & exact,
    )


def control(source: ObservationSource) -> tuple[Observed, ...]:
    """Control points of the block."""
    rows = control_of(source.block)
    coordinates = given_coordinates(source, rows.xyz_m, rows.given)
    observed = observed_control(rows, source.origin_m, source.block.points.id[rows.point], coordinates)
    c = source.block.ground_point_covariances
    if not len(c) or not observed:
        return observed
    scalars = [3 * o.row[:, None] + np.arange(3) for o in observed]
    return joined(observed, 3 * c.row_a + c.axis_a, 3 * c.row_b + c.axis_b, np.asarray(c.value), scalars)


def observed_control(
    rows: Control, origin_m: Float, names: Text, coordinates: GivenCoordinates | None = None, kind: str = KIND
) -> tuple[Observed, ...]:
    """Control points, given their names and their coordinates in the adjustment; none if there is no point."""
    if not len(rows.row):
        return ()
    own_axes = in_own_axes(rows.xyz_m, origin_m, rows.given) if coordinates is None else coordinates
    # Exact coordinates of the block are coordinates of a turned adjustment only where all three of a point are exact.
    is_exact = rows.exact if own_axes.expanded is None else rows.exact & rows.exact.all(axis=1, keepdims=True)

    def evaluate(state: State, chosen: Int) -> tuple[Float, tuple[Float, ...]]:
        v, D = own_axes.residuals(state[POINT][rows.point[chosen]], chosen)
        return v, (D,)

    whitener = whitener_of_covariances(rows.nearly_exact(is_exact), rows.given & ~is_exact)
    active = np.ones(len(rows.row), dtype=bool)
    records = Records(kind, ((POINT, rows.point),), evaluate, whitener, active, linear=own_axes.expanded is None)
    holds = Holds(POINT, rows.point, is_exact, own_axes.place_m) if is_exact.any() else None
    return (Observed(records, rows.row, named(point=names), "m", holds=holds, parts=PARTS, sees=rows.given),)


def origin_of(control: Control, position_m: Float) -> Float:
    """A round place near the block, (3,) m: coordinates are reduced to it before any arithmetic."""
    observed_m = np.concatenate([np.where(control.given, control.xyz_m, np.nan), position_m])
    sums, counts = np.nansum(observed_m, axis=0), np.isfinite(observed_m).sum(axis=0)
    return np.asarray(np.round(sums / np.maximum(counts, 1)))
