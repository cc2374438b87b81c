"""What is east, north, up and height at a place of the frame of the adjustment.

Instruments stand upright: directions, azimuths, zenith angles, heights and height differences refer to the normal and
the height surface at the station, never to the Z axis of the frame. In a frame whose Z is the height everywhere
(`PLANE`: a local frame, or a map frame taken as Cartesian) the two are one; in a tangent frame the normals converge by
32" over a kilometre.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from aatri.arrays import Float
from aatri.frames.expanded import Expanded
from aatri.frames.tangent import TangentFrame
from aatri.units import EARTH_RADIUS_M

WithDerivative = Callable[[Float], tuple[Float, Float]]
"""Coordinates in the frame of the adjustment, (n, 3) m, reduced to its origin -> values and their derivatives."""


@dataclass(frozen=True)
class Level:
    """Local axes, heights and the coordinates that were given."""

    axes: WithDerivative
    """Places -> axes (n, 3, 3), rows: grid east, grid north, up; and by coordinates (n, 3, 3, 3), the last index that
    of the coordinate."""
    height: WithDerivative
    """Places -> height in the vertical datum of the block (n,), but for a constant; by coordinates (n, 3)."""
    coordinates: WithDerivative
    """Places -> coordinates in the block's first frame (n, 3), but for constants; by coordinates (n, 3, 3)."""
    curvature_per_m: float = 0.0
    """1 / R of the Earth; 0 for a frame that knows no Earth."""
    curved: bool = False
    """The axes follow the curvature of the Earth: what remains of it is refraction."""


def _plane_axes(xyz: Float) -> tuple[Float, Float]:
    n = len(xyz)
    return np.broadcast_to(np.eye(3), (n, 3, 3)), np.broadcast_to(0.0, (n, 3, 3, 3))


def _plane_height(xyz: Float) -> tuple[Float, Float]:
    return xyz[:, 2], np.broadcast_to(np.array([0.0, 0.0, 1.0]), (len(xyz), 3))


def _plane_coordinates(xyz: Float) -> tuple[Float, Float]:
    return xyz, np.broadcast_to(np.eye(3), (len(xyz), 3, 3))


PLANE = Level(_plane_axes, _plane_height, _plane_coordinates)
"""Z is the height everywhere, and the axes are parallel."""


def tangent_level(frame: TangentFrame, origin_m: Float) -> Level:
    """Up, north and height in a tangent frame: the axes of the block's grid at each place, its heights and coordinates.

    Parameters
    ----------
    origin_m : (3,) float64, m
        Origin of the adjustment in the tangent frame.
    """
    expanded = Expanded(frame, frame.to_block(origin_m[None])[0])

    def height(xyz: Float) -> tuple[Float, Float]:
        x, D = expanded.coordinates(xyz + origin_m)
        return x[:, 2], D[:, 2]

    return Level(
        lambda xyz: expanded.axes(xyz + origin_m),
        height,
        lambda xyz: expanded.coordinates(xyz + origin_m),
        1.0 / EARTH_RADIUS_M,
        True,
    )


def line_between(level: Level, start: Float, end: Float, start_height: Float, end_height: Float) -> Any:
    """The line from instrument to target in the axes of the station.

        l = E(A) ((B + h_B u(B)) - (A + h_A u(A))),    E rows: east, north, up;  u the last of them

    Parameters
    ----------
    start, end : (n, 3) float64, m
        A and B.
    start_height, end_height : (n,) float64, m
        Instrument and target above their points.

    Returns
    -------
    l : (n, 3) float64, m, by A and by B : (n, 3, 3) float64
    """
    axes, d_axes = level.axes(start)
    line, by_start, by_end = end - start, -np.eye(3), np.eye(3)
    if level.curved:
        far_axes, d_far = level.axes(end)
        line = line + end_height[:, None] * far_axes[:, 2] - start_height[:, None] * axes[:, 2]
        by_start = by_start - start_height[:, None, None] * d_axes[:, 2]
        by_end = by_end + end_height[:, None, None] * d_far[:, 2]
    else:
        line = line + (end_height - start_height)[:, None] * axes[:, 2]
    turned = np.einsum("nijk,nj->nik", d_axes, line) if level.curved else 0.0
    return np.einsum("nij,nj->ni", axes, line), axes @ by_start + turned, axes @ by_end
