"""Refraction of images of any tilt: every ray is turned in its own vertical plane.

    w = R (x, y, -c)                     the ray in level axes at the station, z up
    w_c = (w_1 f, w_2 f, w_3),           f = 1 - K (1 + tan^2 theta),   tan theta = |w_1, w_2| / -w_3
    x_c = -c u_1/u_3,  y_c = -c u_2/u_3,  u = R' w_c

K is the refraction constant of the station (`refraction`, `atmosphere`). A vertical image gives the radial correction
r - K (r + r^3/c^2). Layers are plane: their curvature adds less than 1 % of the correction up to 70 degrees from the
nadir and flying heights of 10 km; rays flatter than `FLATTEST_RAD` are not corrected.

Source: Kraus, Photogrammetry 1; Snell's law in plane layers, see `atmosphere`.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from aatri.camera.corrections.vertical_planes import turned_rays


def refraction_of_rays(
    xy_mm: npt.NDArray[np.floating],
    principal_distance_mm: npt.NDArray[np.floating],
    level_from_image: npt.NDArray[np.floating],
    constant_rad: npt.NDArray[np.floating],
) -> npt.NDArray[np.floating]:
    """Correction to add to the photo coordinates, freed from lens distortion.

    Parameters
    ----------
    xy_mm : (n, 2) float64, mm, from the principal point
    principal_distance_mm : (n,) float64, mm
    level_from_image : (n, 3, 3) float64
        Rotations of the images to level axes at their stations, z up.
    constant_rad : (n,) float64, rad
        K of each ray's image.

    Returns
    -------
    (n, 2) float64, mm
        NaN where a ray is flatter than `FLATTEST_RAD`.
    """
    return turned_rays(xy_mm, principal_distance_mm, level_from_image, lambda tan2: 1.0 - constant_rad * (1.0 + tan2))
