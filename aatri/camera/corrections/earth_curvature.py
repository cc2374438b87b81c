"""Earth curvature of near-vertical images, for adjustment in a map frame with heights above sea level.

    r_corrected = r + H' r^3 / (2 R c^2)

H' is the flying height above the terrain, R = 6371 km, r the distance from the principal point. A point of the curved
earth lies below the tangent plane and its image too far in; the correction moves it outwards. In a tangent or
geocentric Cartesian frame there is nothing to correct.

Source: Manual of Photogrammetry (ASPRS); Kraus, Photogrammetry 1.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

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


def earth_curvature_derivative(
    xy_mm: npt.NDArray[Any], flying_height_m: npt.NDArray[Any], principal_distance_mm: npt.NDArray[Any]
) -> npt.NDArray[Any]:
    """Derivative of the correction with respect to the photo coordinates, (n, 2, 2)."""
    isotropic = (xy_mm**2).sum(axis=1)[:, None, None] * np.eye(2)
    outer = 2.0 * xy_mm[:, :, None] * xy_mm[:, None, :]
    return np.asarray(_factor(flying_height_m, principal_distance_mm)[:, None, None] * (isotropic + outer))


def _factor(flying_height_m: npt.NDArray[Any], principal_distance_mm: npt.NDArray[Any]) -> npt.NDArray[Any]:
    return np.asarray(flying_height_m / (2.0 * EARTH_RADIUS_M * principal_distance_mm**2))
