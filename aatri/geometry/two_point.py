"""The ground-photogrammetric frame tp: right-handed, its plan turned and scaled to the strip by two control points.

    (X, Y)tp = [b a; a -b] (N - N1, E - E1),   Ztp = lambda (H - H1),   lambda^2 = a^2 + b^2
    (N, E) = 1/lambda^2 [b a; a -b] (X, Y)tp + (N1, E1),   H = Ztp / lambda + H1

(N, E, H) is geodetic and left-handed, north before east; the matrix is its own inverse but for lambda^2 and turns the
handedness. With two points 1, 2 known in both, d their difference:

    a = (dXtp dE + dYtp dN) / (dN^2 + dE^2),   b = (dXtp dN - dYtp dE) / (dN^2 + dE^2)

Source: lecture notes A501, A607, erratum E14.
"""

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Float
from aatri.errors import GeometryError


@dataclass(frozen=True)
class TwoPointFrame:
    """The frame: a, b, and the first point in north, east, height (m) and in the plan and height of tp."""

    a: float
    b: float
    north_east_height_m: Float
    xyz_tp: Float

    @property
    def scale(self) -> float:
        """lambda: units of tp per metre."""
        return float(np.hypot(self.a, self.b))

    def from_ground(self, north_east_height_m: Float) -> Float:
        """Points (n, 3) in tp."""
        d = north_east_height_m - self.north_east_height_m
        plan = d[:, :2] @ np.array([[self.b, self.a], [self.a, -self.b]])
        return np.column_stack([plan, self.scale * d[:, 2]]) + self.xyz_tp

    def to_ground(self, xyz_tp: Float) -> Float:
        """Points (n, 3) in north, east, height, m."""
        d = xyz_tp - self.xyz_tp
        plan = d[:, :2] @ np.array([[self.b, self.a], [self.a, -self.b]]) / self.scale**2
        return np.column_stack([plan, d[:, 2] / self.scale]) + self.north_east_height_m


def two_point_frame(xyz_tp: Float, north_east_height_m: Float) -> TwoPointFrame:
    """The frame of two points.

    Parameters
    ----------
    xyz_tp : (2, 3) float64
        In the strip, levelled; their unit is that of tp. The height of the first is matched.
    north_east_height_m : (2, 3) float64, m

    Raises
    ------
    GeometryError
        If the points lie on one another in plan.
    """
    dX, dY = (xyz_tp[1] - xyz_tp[0])[:2]
    dN, dE = (north_east_height_m[1] - north_east_height_m[0])[:2]
    square = float(dN * dN + dE * dE)
    if square == 0.0 or float(dX * dX + dY * dY) == 0.0:
        raise GeometryError("two points of the same place make no frame", remedy="take two points far apart")
    a, b = float((dX * dE + dY * dN) / square), float((dX * dN - dY * dE) / square)
    return TwoPointFrame(a, b, np.asarray(north_east_height_m[0]), np.asarray(xyz_tp[0]))


def farthest_apart(xy: Float) -> list[int]:
    """Two of some places (n, 2), about the farthest apart: one farthest from the middle, one farthest from that.

    Examples
    --------
    >>> farthest_apart(np.array([[0.0, 0.0], [1.0, 0.0], [5.0, 1.0]]))
    [2, 0]
    """
    first = int(np.argmax(np.linalg.norm(xy - xy.mean(axis=0), axis=1)))
    return [first, int(np.argmax(np.linalg.norm(xy - xy[first], axis=1)))]
