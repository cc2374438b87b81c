"""Earth curvature, for adjustment in a map frame with heights above sea level.

    r_corrected = r + H' r^3 / (2 R c^2)                        near-vertical images
    w = R (x, y, -c),   tan theta = |w_1, w_2| / -w_3,          images of any tilt, ray by ray, level axes, z up
    (w_1, w_2) <- (w_1, w_2) (1 + H' tan^2 theta / (2 R))

H' is the flying height above the terrain, R = 6371 km, r the distance from the principal point. A point of the curved
earth lies below the tangent plane and its image too far in; the correction moves it outwards. In a tangent or
geocentric Cartesian frame there is nothing to correct. A ray that meets the ground at the distance D meets it
D^2 / (2 R) below the plane, H' + D^2 / (2 R) under the camera; in the map it lies at H'. A vertical image gives the
first form.

Source: Manual of Photogrammetry (ASPRS); Kraus, Photogrammetry 1.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.camera.corrections.vertical_planes import turned_rays
from aatri.units import EARTH_RADIUS_M


def earth_curvature_correction(
    xy_mm: npt.NDArray[Any], flying_height_m: npt.NDArray[Any], principal_distance_mm: npt.NDArray[Any]
) -> npt.NDArray[Any]:
    """Correction to add to the photo coordinates, freed from lens distortion and refraction.

    Parameters
    ----------
    xy_mm : (n, 2) float64, mm, from the principal point
    flying_height_m : (n,) float64, m above the terrain
    principal_distance_mm : (n,) float64, mm

    Returns
    -------
    (n, 2) float64, mm
    """
    return np.asarray(xy_mm * (_factor(flying_height_m, principal_distance_mm) * (xy_mm**2).sum(axis=1))[:, None])


def earth_curvature_of_rays(
    xy_mm: npt.NDArray[Any],
    flying_height_m: npt.NDArray[Any],
    principal_distance_mm: npt.NDArray[Any],
    level_from_image: npt.NDArray[Any],
) -> npt.NDArray[Any]:
    """Correction of images of any tilt, see `earth_curvature_correction`.

    Parameters
    ----------
    xy_mm, flying_height_m, principal_distance_mm
    level_from_image : (n, 3, 3) float64
        Rotations of the images to level axes at their stations, z up.

    Returns
    -------
    (n, 2) float64, mm
        NaN where a ray is flatter than `FLATTEST_RAD`.
    """
    factor = flying_height_m / (2.0 * EARTH_RADIUS_M)
    return turned_rays(xy_mm, principal_distance_mm, level_from_image, lambda tan2: 1.0 + factor * tan2)


def _factor(flying_height_m: npt.NDArray[Any], principal_distance_mm: npt.NDArray[Any]) -> npt.NDArray[Any]:
    return np.asarray(flying_height_m / (2.0 * EARTH_RADIUS_M * principal_distance_mm**2))
