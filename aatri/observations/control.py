"""Control points: given ground coordinates, each coordinate observed or exact.

    v = X - X_given,    dv/dX = 1

A coordinate of variance zero is exact: it is held at its value. Any other is an observation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from aatri.adjustment.records import Records, whitener_of_covariances
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int, Text
from aatri.codes import CONTROL
from aatri.observations.observed import Given, Holds, Observed, named
from aatri.observations.poses import POINT

if TYPE_CHECKING:
    from aatri.artifacts.block import Block

KIND = "control"

PARTS = (("plan", (0, 1)), ("height", (2,)))
"""Components of control that are measured apart."""

USES = ("ground_points.xyz_m", "ground_points.covariance_m2")


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
    found = control_of(given.block)
    return observed_control(found, given.origin_m, given.block.points.id[found.point])


def observed_control(rows: Control, origin_m: Float, names: Text) -> tuple[Observed, ...]:
    """Control points, given their names; none if there is no point."""
    if not len(rows.row):
        return ()
    used = rows.given
    xyz_m = np.where(used, rows.xyz_m - origin_m, 0.0)
    derivative = np.eye(3) * used[:, :, None]

    def evaluate(state: State, some: Int) -> tuple[Float, tuple[Float, ...]]:
        v = np.where(used[some], state[POINT][rows.point[some]] - xyz_m[some], 0.0)
        return v, (derivative[some],)

    whitener = whitener_of_covariances(rows.covariance_m2, rows.observed)
    active = np.ones(len(rows.row), dtype=bool)
    records = Records(KIND, ((POINT, rows.point),), evaluate, whitener, active)
    holds = Holds(POINT, rows.point, rows.exact, xyz_m) if rows.exact.any() else None
    return (Observed(records, rows.row, named(point=names), "m", holds=holds, parts=PARTS, sees=used),)
