"""Differences between two stations: of height, levelled or trigonometric, and of coordinates, as GNSS baselines are.

    height_difference      v = (H(B) + h_B) - (H(A) + h_A) - dh
    coordinate_difference  v = (X(B) + h_B u(B)) - (X(A) + h_A u(A)) - d,    one coordinate of it a row

H is the height in the vertical datum of the block: Z in a local or map frame, the height above the surface of the datum
in a tangent frame. X are coordinates in the axes of the block's first frame, u is the vertical, h are the heights of
instruments, targets and antennas above their points. The three rows of a baseline are correlated by covariances.csv,
see `correlated`. Source: docs/formulas.md 5.4.
"""

from dataclasses import replace

import numpy as np

from aatri.arrays import Float
from aatri.observations.geodetic.sights import HEIGHT, Measured, observed_sights, sights_of
from aatri.observations.level import Level
from aatri.observations.observed import ObservationSource, Observed

HEIGHT_DIFFERENCE, COORDINATE_DIFFERENCE = "height_difference", "coordinate_difference"
"""Names of the kinds."""

AXES = ("dX", "dY", "dZ")

USES = (
    *(f"geodetic:{type_}{end}" for type_ in (HEIGHT_DIFFERENCE, *AXES) for end in ("", "_to_image")),
    "geodetic.heights",
)


def height_differences(source: ObservationSource) -> tuple[Observed, ...]:
    """Height differences of the geodetic observations."""
    rows = sights_of(source.block, HEIGHT_DIFFERENCE)
    return tuple(observed_sights(HEIGHT_DIFFERENCE, rows, source.level, along(2), "m", HEIGHT, between_heights))


def coordinate_differences(source: ObservationSource) -> tuple[Observed, ...]:
    """Coordinate differences of the geodetic observations."""
    observed = list[Observed]()
    for axis, type_ in enumerate(AXES):
        rows = sights_of(source.block, type_)
        rows = replace(rows, names=np.char.add(rows.names, f" {type_}"))
        sees = (axis == 0, axis == 1, axis == 2)
        observed += observed_sights(
            COORDINATE_DIFFERENCE, rows, source.level, along(axis), "m", sees, between_coordinates
        )
    return tuple(observed)


def along(axis: int) -> Measured:
    """One coordinate of the line."""
    return lambda line: (line[:, axis], np.broadcast_to(np.eye(3)[axis], line.shape))


def between_heights(level: Level, start: Float, end: Float, low: Float, high: Float) -> tuple[Float, Float, Float]:
    """Height differences as lines upwards."""
    up = np.array([0.0, 0.0, 1.0])
    (a, by_start), (b, by_end) = level.height(start), level.height(end)
    return (b + high - a - low)[:, None] * up, -up[:, None] * by_start[:, None, :], up[:, None] * by_end[:, None, :]


def between_coordinates(level: Level, start: Float, end: Float, low: Float, high: Float) -> tuple[Float, Float, Float]:
    """Lines in coordinates of the block's first frame, and their derivatives."""
    (a, by_start), (b, by_end) = _above(level, start, low), _above(level, end, high)
    return b - a, -by_start, by_end


def _above(level: Level, xyz: Float, height: Float) -> tuple[Float, Float]:
    """Coordinates of the block's first frame at a height above some places, and their derivatives."""
    up, d_up = (a[:, 2] for a in level.axes(xyz))
    coordinates, J = level.coordinates(xyz + height[:, None] * up)
    return coordinates, J @ (np.eye(3) + height[:, None, None] * d_up)
