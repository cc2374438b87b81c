"""Control points: given ground coordinates, each coordinate observed or exact.

    v = D (X - X_given),    dv/dX = D

A coordinate of variance zero is exact: it is held at its value. Any other is an observation. D is I where the
adjustment is in the axes of the block, else it turns the residual into them (`Given.placed`). Control in plan or in
height only has no place there; it is compared in the coordinates of the block, v = x(X) - x_given, so that it stays
right at any distance from the origin; x is the map of the frame (`frames.expanded`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from aatri.adjustment.records import Records, whitener_of_covariances
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int, Text
from aatri.codes import CONTROL
from aatri.frames.expanded import Expanded
from aatri.frames.tangent import TangentFrame
from aatri.observations.correlated import joined
from aatri.observations.observed import NEARLY_EXACT, Given, Holds, Observed, named
from aatri.observations.poses import POINT

if TYPE_CHECKING:
    from aatri.artifacts.block import Block

KIND = "control"

PARTS = (("plan", (0, 1)), ("height", (2,)))
"""Components of control that are measured apart."""

USES = ("ground_points.xyz_m", "ground_points.covariance_m2", "ground_point_covariances")


@dataclass(frozen=True)
class Control:
    """Control points.

    Attributes
    ----------
    row : (n,) int32
        Row in the Block's ground_points.
    point : (n,) int32
        Row in points.
    xyz_m : (n, 3) float64, m
    covariance_m2 : (n, 3, 3) float64, m^2
    observed : (n, 3) bool
        The coordinate is control, with a standard deviation.
    exact : (n, 3) bool
        The coordinate is control and exact.
    """

    row: Int
    point: Int
    xyz_m: Float
    covariance_m2: Float
    observed: Bool
    exact: Bool

    @property
    def given(self) -> Bool:
        """Coordinates that are control, (n, 3)."""
        return self.observed | self.exact

    def take(self, some: Int) -> Control:
        """The chosen points."""
        return Control(*(getattr(self, name)[some] for name in self.__dataclass_fields__))

    def nearly_exact(self, held: Bool) -> Float:
        """Covariances in which exact coordinates that are not held have a very small variance, (n, 3, 3)."""
        covariance = self.covariance_m2.copy()
        row, axis = np.nonzero(self.exact & ~held)
        covariance[row, axis, axis] = NEARLY_EXACT**2
        return covariance


def control_of(block: Block) -> Control:
    """Control points of a block, in the order of its ground_points."""
    ground = block.ground_points
    wanted = (ground.role == CONTROL) & np.isfinite(ground.xyz_m)
    row = np.flatnonzero(wanted.any(axis=1)).astype(np.int32)
    exact = np.einsum("nii->ni", ground.covariance_m2)[row] == 0
    return Control(
        row,
        ground.point[row],
        ground.xyz_m[row],
        ground.covariance_m2[row],
        wanted[row] & ~exact,
        wanted[row] & exact,
    )


def control(given: Given) -> tuple[Observed, ...]:
    """Control points of the block."""
    observed = _control(given)
    c = given.block.ground_point_covariances
    if not len(c) or not observed:
        return observed
    scalars = [3 * o.row[:, None] + np.arange(3) for o in observed]
    return joined(observed, 3 * c.row_a + c.axis_a, 3 * c.row_b + c.axis_b, np.asarray(c.value), scalars)


def _control(given: Given) -> tuple[Observed, ...]:
    """Control points, each by itself."""
    found = control_of(given.block)
    if given.frame is None:
        return observed_control(found, given.origin_m, given.block.points.id[found.point])
    full = found.given.all(axis=1)
    whole, part = found.take(np.flatnonzero(full)), found.take(np.flatnonzero(~full))
    xyz_m, derivatives = given.placed(whole.xyz_m)
    ids = given.block.points.id
    return (
        *observed_control(replace(whole, xyz_m=xyz_m), given.origin_m, ids[whole.point], derivatives),
        *_control_in_part(part, given.frame, given.origin_m, ids[part.point]),
    )


def observed_control(
    rows: Control, origin_m: Float, names: Text, derivatives: Float | None = None
) -> tuple[Observed, ...]:
    """Control points, given their names and the D of each; none if there is no point."""
    if not len(rows.row):
        return ()
    held = rows.exact
    if derivatives is not None:  # exact coordinates of the block are none of the adjustment, but for whole points
        held = rows.exact & rows.exact.all(axis=1, keepdims=True)
    used = rows.given
    xyz_m = np.where(used, rows.xyz_m - origin_m, 0.0)
    D = np.eye(3) * used[:, :, None] if derivatives is None else derivatives

    def evaluate(state: State, some: Int) -> tuple[Float, tuple[Float, ...]]:
        away = np.where(used[some], state[POINT][rows.point[some]] - xyz_m[some], 0.0)
        return np.einsum("nij,nj->ni", D[some], away), (D[some],)

    whitener = whitener_of_covariances(rows.nearly_exact(held), used & ~held)
    active = np.ones(len(rows.row), dtype=bool)
    records = Records(KIND, ((POINT, rows.point),), evaluate, whitener, active)
    holds = Holds(POINT, rows.point, held, xyz_m) if held.any() else None
    return (Observed(records, rows.row, named(point=names), "m", holds=holds, parts=PARTS, sees=used),)


def _control_in_part(rows: Control, frame: TangentFrame, origin_m: Float, names: Text) -> tuple[Observed, ...]:
    """Control in plan or in height only, compared in the coordinates of the block."""
    if not len(rows.row):
        return ()
    used, reference = rows.given, frame.to_block(origin_m[None])[0]
    expanded, given_m = Expanded(frame, reference), rows.xyz_m - reference

    def evaluate(state: State, some: Int) -> tuple[Float, tuple[Float, ...]]:
        x, D = expanded.coordinates(state[POINT][rows.point[some]] + origin_m)
        return np.where(used[some], x - given_m[some], 0.0), (D * used[some][:, :, None],)

    none = np.zeros_like(rows.exact)
    whitener = whitener_of_covariances(rows.nearly_exact(none), used)
    records = Records(KIND, ((POINT, rows.point),), evaluate, whitener, np.ones(len(rows.row), dtype=bool))
    return (Observed(records, rows.row, named(point=names), "m", parts=PARTS, sees=used),)
