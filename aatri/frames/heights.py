"""Heights above sea level, which refraction needs, from coordinates in the block's frame.

In a map frame the third coordinate is the height. In a Cartesian frame tangent to a spherical earth of radius R at
its origin (0, 0, 0), exactly

    h = sqrt(X^2 + Y^2 + (R + Z)^2) - R

A tangent frame says so by its crs, `+proj=topocentric ...`; in any other frame the third coordinate is taken for the
height.
"""

import numpy as np

from aatri.arrays import Float
from aatri.units import EARTH_RADIUS_M

TOPOCENTRIC = "+proj=topocentric"


def is_tangent_frame(crs: str) -> bool:
    """Whether a frame is Cartesian and touches the earth at its origin.

    Parameters
    ----------
    crs : str
        Coordinate reference system of the frame, as in the block.
    """
    return TOPOCENTRIC in crs


def height_above_sea_level(xyz_m: Float, *, tangent: bool) -> Float:
    """Height above sea level of points.

    Parameters
    ----------
    xyz_m : (n, 3) float64, m
    tangent : bool
        Whether the frame is tangent to the spherical earth at its origin; else Z is the height.

    Returns
    -------
    (n,) float64, m
    """
    if not tangent:
        return np.array(xyz_m[:, 2], dtype=np.float64)
    X, Y, Z = xyz_m.T
    # h = (X^2 + Y^2 + 2 R Z + Z^2) / (sqrt(...) + R): the same without the difference of two large numbers
    s = X**2 + Y**2 + Z**2 + 2.0 * EARTH_RADIUS_M * Z
    return np.asarray(s / (np.sqrt(EARTH_RADIUS_M**2 + s) + EARTH_RADIUS_M))
