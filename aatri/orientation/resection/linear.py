"""Start of a resection by the direct linear transformation: eleven unknowns, no approximate values, no iteration.

    x = (L1 X + L2 Y + L3 Z + L4) / w,   y = (L5 X + L6 Y + L7 Z + L8) / w,   w = L9 X + L10 Y + L11 Z + L12

Six and more points, not in a plane, give the rows of the 3 x 4 matrix as the singular vector of least singular value of
the equations; coordinates are reduced to their means and to unit spread before (Hartley 1997). The matrix is
diag(-c, -c, 1) R' (I | -X0) up to a factor: the projection centre is its null vector; R comes from the other
columns with the known c, made orthogonal.

Source: Abdel-Aziz and Karara 1971; Hartley and Zisserman, Multiple View Geometry, 7.1.
"""

import numpy as np

from aatri.arrays import Float
from aatri.geometry.collinearity import in_image_axes
from aatri.geometry.rotations import nearest_rotation

FEWEST = 6
FLAT = 1e-3
"""Points whose least spread is below this times the largest lie in a plane, for which the transformation is open."""


def linear_orientation(xy_mm: Float, c_mm: float, xyz_m: Float) -> tuple[Float, Float] | None:
    """Orientation of one image by the direct linear transformation.

    Parameters
    ----------
    xy_mm : (n, 2) float64, mm, from the principal point
    c_mm : float, mm
    xyz_m : (n, 3) float64, m

    Returns
    -------
    position_m : (3,) float64, m
    ground_from_image : (3, 3) float64
        None with fewer than six points, with points in a plane, or if points come out behind the camera.
    """
    if len(xy_mm) < FEWEST:
        return None
    centre = xyz_m.mean(axis=0)
    spread = np.linalg.svd(xyz_m - centre, compute_uv=False)
    if spread[2] <= FLAT * spread[0]:
        return None
    size = float(np.linalg.norm(xyz_m - centre, axis=1).mean())
    X = np.column_stack([(xyz_m - centre) / size, np.ones(len(xyz_m))])
    ray = xy_mm / c_mm
    A = np.zeros((2 * len(X), 12))
    A[0::2, :4], A[0::2, 8:] = X, -ray[:, :1] * X
    A[1::2, 4:8], A[1::2, 8:] = X, -ray[:, 1:] * X
    P = np.linalg.svd(A)[2][-1].reshape(3, 4)
    homogeneous = np.linalg.svd(P)[2][-1]
    if abs(homogeneous[3]) < 1e-12:
        return None
    position = centre + size * homogeneous[:3] / homogeneous[3]
    turned = np.diag([-1.0, -1.0, 1.0]) @ P[:, :3]  # R' up to a factor
    rotation = nearest_rotation((turned * np.sign(np.linalg.det(turned))).T)
    if (in_image_axes(position[None], rotation[None], xyz_m)[:, 2] >= 0).any():
        return None
    return np.asarray(position), rotation
