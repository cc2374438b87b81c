"""Collinearity: projection centre, image point and ground point lie on one line.

With u = R'(X - X0), the ground point in the axes of the image,

    x = -c u1 / u3,    y = -c u2 / u3,

x and y from the principal point, c the principal distance; a point in front of the camera has u3 < 0.
The derivatives are split at u: the pose gives u and its derivatives, the camera gives x, y from u with theirs.

    du/dX = R',   du/dX0 = -R',   du/dd = R' [X - X0]x     for R <- exp([d]x) R
    dx/du = -c/u3 (1, 0, -u1/u3),   dx/dc = x/c            and y alike

Source: Kraus, Photogrammetry; docs/formulas.md 2.1.
"""

import numpy as np

from aatri.arrays import Float
from aatri.geometry.rotations import skew


def in_image_axes(X0: Float, ground_from_image: Float, X: Float) -> Float:
    """Ground points in the axes of their images, u = R'(X - X0).

    Parameters
    ----------
    X0 : (n, 3) float64, m
    ground_from_image : (n, 3, 3) float64
    X : (n, 3) float64, m

    Returns
    -------
    (n, 3) float64, m

    Examples
    --------
    >>> in_image_axes(np.array([[0.0, 0.0, 1000.0]]), np.eye(3)[None], np.array([[50.0, 20.0, 100.0]]))
    array([[  50.,   20., -900.]])
    """
    return np.asarray(np.einsum("nji,nj->ni", ground_from_image, X - X0))


def project(u: Float, c_mm: Float) -> Float:
    """Image coordinates of points given in the axes of the image.

    Parameters
    ----------
    u : (n, 3) float64
    c_mm : (n,) or scalar float64, mm

    Returns
    -------
    (n, 2) float64, mm, from the principal point

    Examples
    --------
    A point 100 m to the right and 1500 m below a vertical image of c = 150 mm:

    >>> project(np.array([[100.0, 0.0, -1500.0]]), 150.0) + 0.0
    array([[10.,  0.]])
    """
    return np.asarray(-np.asarray(c_mm)[..., None] * u[..., :2] / u[..., 2:])


def project_derivatives(u: Float, c_mm: Float) -> tuple[Float, Float]:
    """Image coordinates and their derivatives with respect to u; that to c is xy / c.

    Returns
    -------
    xy_mm : (n, 2) float64, mm
    xy_by_u : (n, 2, 3) float64, mm per unit of u
    """
    xy = project(u, c_mm)
    factor = -np.asarray(c_mm) / u[..., 2]
    by_u = np.zeros((*u.shape[:-1], 2, 3), dtype=u.dtype)
    by_u[..., 0, 0] = by_u[..., 1, 1] = factor
    by_u[..., :, 2] = -xy / u[..., 2:]
    return xy, by_u


def collinearity(X0: Float, ground_from_image: Float, X: Float, c_mm: Float) -> tuple[Float, Float, Float]:
    """Image coordinates with derivatives to the pose and to the ground point.

    Parameters
    ----------
    X0, ground_from_image, X, c_mm
        As above, one row per ray.

    Returns
    -------
    xy_mm : (n, 2) float64, mm
    by_pose : (n, 2, 6) float64
        To X0 (mm/m) and to d (mm/rad), R <- exp([d]x) R.
    by_point : (n, 2, 3) float64, mm/m
    """
    u = in_image_axes(X0, ground_from_image, X)
    xy, by_u = project_derivatives(u, c_mm)
    by_point = np.einsum("nij,nkj->nik", by_u, ground_from_image)
    by_pose = np.concatenate([-by_point, by_point @ skew(X - X0)], axis=2)
    return xy, by_pose, by_point
