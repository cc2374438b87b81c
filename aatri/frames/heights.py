"""Heights above sea level, which refraction needs, from coordinates in the block's frame.

In a map frame the third coordinate is the height. In a Cartesian frame tangent to a spherical earth of radius R at
its origin (0, 0, 0), exactly

    h = sqrt(X^2 + Y^2 + (R + Z)^2) - R

A Cartesian frame whose coordinates are far from its origin cannot be tangent there; its Z is taken for the height. So
a frame counts as tangent if all coordinates lie within 100 km of the origin.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from aatri.units import EARTH_RADIUS_M

Float = npt.NDArray[np.float64]

TANGENT_EXTENT_M = 100_000.0
"""Coordinates of a tangent frame lie within this distance of its origin."""


def is_tangent_frame(earth_curvature: str, xyz_m: Float) -> bool:
    """Whether coordinates are those of a frame tangent at its origin.

    Parameters
    ----------
    earth_curvature : str
        As in the block: correct (a map frame), ignore or frame.
    xyz_m : (n, 3) float64, m
        All coordinates there are; NaN is not given.
    """
    plan = xyz_m[:, :2][np.isfinite(xyz_m[:, :2]).all(axis=1)]
    near = bool((np.abs(plan) <= TANGENT_EXTENT_M).all())
    return earth_curvature != "correct" and near


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
