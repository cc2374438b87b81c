"""Refraction and earth curvature: every ray is turned in its own vertical plane.

    w = R (x, y, -c)                     the ray in level axes at the station, z up
    w_c = (w_1 f, w_2 f, w_3),           tan theta = |w_1, w_2| / -w_3
    x_c = -c u_1/u_3,  y_c = -c u_2/u_3,  u = R' w_c

    refraction        f = 1 - K (1 + tan^2 theta)        K the constant of the station (`atmosphere`)
    earth curvature   f = 1 + H' tan^2 theta / (2 R)     H' the flying height above the terrain, R = 6371 km

In a near-vertical image R = I, tan theta = r / c: r - K (r + r^3/c^2), and r + H' r^3 / (2 R c^2). Refraction bends the
ray so that the image lies too far out. A point of the curved earth lies below the tangent plane and its image too far
in: a ray that meets the ground at the distance D meets it D^2 / (2 R) below the plane, and in a map frame with heights
above sea level it lies at H'. In a tangent or geocentric Cartesian frame there is no curvature to correct.

Layers are plane: their curvature adds less than 1 % of the correction up to 70 degrees from the nadir and flying
heights of 10 km; rays of oriented images flatter than `FLATTEST_RAD` are not corrected.

Source: Manual of Photogrammetry (ASPRS); Kraus, Photogrammetry 1; Snell's law in plane layers, see `atmosphere`.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.camera.limits import FLATTEST_RAD
from aatri.units import EARTH_RADIUS_M

Array = npt.NDArray[Any]


def refraction_correction(
    xy_mm: Array, constant_rad: Array, principal_distance_mm: Array, level_from_image: Array | None = None
) -> Array:
    """Correction to add to the photo coordinates, freed from lens distortion.

    Parameters
    ----------
    xy_mm : (n, 2) float64, mm, from the principal point
    constant_rad : (n,) float64, rad
        K of each point's image.
    principal_distance_mm : (n,) float64, mm
    level_from_image : (n, 3, 3) float64, optional
        Rotations of the images to level axes at their stations, z up; not given: near-vertical.

    Returns
    -------
    (n, 2) float64, mm
        NaN where a ray of an oriented image is flatter than `FLATTEST_RAD`.
    """
    tan2 = _squared_tangents(xy_mm, principal_distance_mm, level_from_image)
    return _turned(xy_mm, principal_distance_mm, level_from_image, -constant_rad * (1.0 + tan2))


def earth_curvature_correction(
    xy_mm: Array, flying_height_m: Array, principal_distance_mm: Array, level_from_image: Array | None = None
) -> Array:
    """Correction to add to the photo coordinates, freed from lens distortion and refraction.

    Parameters
    ----------
    flying_height_m : (n,) float64, m above the terrain
    xy_mm, principal_distance_mm, level_from_image
        As of `refraction_correction`.
    """
    tan2 = _squared_tangents(xy_mm, principal_distance_mm, level_from_image)
    return _turned(xy_mm, principal_distance_mm, level_from_image, flying_height_m / (2.0 * EARTH_RADIUS_M) * tan2)


def _levelled(xy_mm: Array, c_mm: Array, level: Array) -> Array:
    return np.asarray(np.einsum("nij,nj->ni", level, np.concatenate([xy_mm, -c_mm[:, None]], axis=1)))


def _squared_tangents(xy_mm: Array, c_mm: Array, level: Array | None) -> Array:
    """tan^2 theta, (n,); NaN where a ray is too flat."""
    if level is None:
        return np.asarray(xy_mm**2 @ np.ones(2) / c_mm**2)
    w = _levelled(xy_mm, c_mm, level)
    with np.errstate(divide="ignore", invalid="ignore"):
        tan2 = (w[:, 0] ** 2 + w[:, 1] ** 2) / w[:, 2] ** 2
    return np.where((w[:, 2] < 0) & (tan2 <= np.tan(FLATTEST_RAD) ** 2), tan2, np.nan)


def _turned(xy_mm: Array, c_mm: Array, level: Array | None, change: Array) -> Array:
    """What rays move by in the image where their distance from the nadir changes by the share f - 1, (n, 2) mm."""
    if level is None:
        return np.asarray(xy_mm * change[:, None])
    w = _levelled(xy_mm, c_mm, level)
    w[:, :2] *= (1.0 + change)[:, None]
    u = np.einsum("nji,nj->ni", level, w)
    return np.asarray(-c_mm[:, None] * u[:, :2] / u[:, 2:] - xy_mm)
