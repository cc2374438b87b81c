"""Atmospheric refraction of near-vertical images, standard atmosphere ARDC 1959 in closed form.

    K = [2410 H / (H^2 - 6 H + 250) - 2410 h / (h^2 - 6 h + 250) h / H] 1e-6     rad; H, h in km above sea level
    r_corrected = r - K (r + r^3 / c^2)

H is the height of the projection centre, h that of the terrain, r the distance from the principal point. The ray is
bent so that the image lies too far out; the correction moves it inwards.

Source: Manual of Photogrammetry (ASPRS), refraction in the ARDC 1959 atmosphere.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt


def refraction_constant(station_height_m: npt.ArrayLike, terrain_height_m: npt.ArrayLike) -> npt.NDArray[Any]:
    """Refraction constant K: the angle by which refraction displaces a ray at 45 degrees.

    Parameters
    ----------
    station_height_m, terrain_height_m : (...,) float64, m above sea level

    Returns
    -------
    (...,) float64, rad
    """
    H, h = np.asarray(station_height_m) / 1000.0, np.asarray(terrain_height_m) / 1000.0
    upper = 2410.0 * H / (H**2 - 6.0 * H + 250.0)
    lower = 2410.0 * h / (h**2 - 6.0 * h + 250.0) * h / H
    return np.asarray((upper - lower) * 1e-6)


def refraction_correction(
    xy_mm: npt.NDArray[Any], constant_rad: npt.NDArray[Any], principal_distance_mm: npt.NDArray[Any]
) -> npt.NDArray[Any]:
    """Correction to add to the photo coordinates, freed from lens distortion.

    Parameters
    ----------
    xy_mm : (n, 2) float64, mm, from the principal point
    constant_rad : (n,) float64, rad
        K of each point's image.
    principal_distance_mm : (n,) float64, mm

    Returns
    -------
    (n, 2) float64, mm
    """
    r2 = xy_mm**2 @ np.ones(2)
    return np.asarray(-xy_mm * (constant_rad * (1.0 + r2 / principal_distance_mm**2))[:, None])
