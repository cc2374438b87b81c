"""Rays of an image turned each in its own vertical plane.

w = R (x, y, -c)                       the ray in level axes at the station, z up
w_c = (w_1 f, w_2 f, w_3),             f a function of tan^2 theta, tan theta = |w_1, w_2| / -w_3
x_c = -c u_1/u_3,  y_c = -c u_2/u_3,   u = R' w_c
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

FLATTEST_RAD = np.deg2rad(80.0)
"""Largest angle from the nadir."""


def turned_rays(
    xy_mm: npt.NDArray[Any],
    principal_distance_mm: npt.NDArray[Any],
    level_from_image: npt.NDArray[Any],
    factor: Callable[[npt.NDArray[Any]], npt.NDArray[Any]],
) -> npt.NDArray[Any]:
    """Correction to add to photo coordinates, (n, 2) float64, mm; NaN where a ray is flatter than `FLATTEST_RAD`.

    Parameters
    ----------
    xy_mm : (n, 2) float64, mm, from the principal point
    principal_distance_mm : (n,) float64, mm
    level_from_image : (n, 3, 3) float64
        Rotations of the images to level axes at their stations, z up.
    factor : callable
        tan^2 of the angle from the nadir, (n,) -> f, (n,).
    """
    c = principal_distance_mm
    u = np.concatenate([xy_mm, -c[:, None]], axis=1)
    w = np.einsum("nij,nj->ni", level_from_image, u)
    with np.errstate(divide="ignore", invalid="ignore"):
        tan2 = (w[:, 0] ** 2 + w[:, 1] ** 2) / w[:, 2] ** 2
    steep = (w[:, 2] < 0) & (tan2 <= np.tan(FLATTEST_RAD) ** 2)
    turned = np.concatenate([w[:, :2] * np.where(steep, factor(tan2), np.nan)[:, None], w[:, 2:]], axis=1)
    u = np.einsum("nji,nj->ni", level_from_image, turned)
    return np.asarray(-c[:, None] * u[:, :2] / u[:, 2:] - xy_mm)
