"""Space intersection: points from the rays of two or more images.

Two rays, in the frame of the left image with the base b and w = R u2: after the smallest correction of the image
coordinates that makes them coplanar with the base (`geometry.coplanarity.corrected`), they meet at

    X = l1 u1 = b + l2 w,   l1 = (b x w) . (u1 x w) / |u1 x w|^2,   l2 = (b x u1) . (u1 x w) / |u1 x w|^2

l1 and l2 are the point projection coefficients N1 and N2, formed from all three components. Both are positive for a
point in front of its images. The covariance is that of least squares with the four image coordinates.

Many rays from X0 with unit directions u: the point nearest to all of them, sum (I - u u') (X - X0) = 0.

Source: docs/formulas.md 3.4; Hartley & Zisserman, Multiple View Geometry, ch. 12.
"""

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Float, Int, finite_rows
from aatri.geometry.coplanarity import RayPairs, corrected

PARALLEL = 1e-12
"""Rays whose directions differ less, as the square of the sine or relative eigenvalue, do not meet."""


@dataclass(frozen=True)
class Intersection:
    """Points intersected from two images."""

    xyz: Float
    """(n, 3), unit of the base. NaN where the rays are parallel."""
    covariance: Float
    """(n, 3, 3). From the image coordinates, orientation held; NaN where the rays are parallel."""
    depth: Float
    """(n, 2). Projection coefficients l1 and l2; positive in front of the image."""


def intersect_pair(left_from_right: Float, base: Float, rays: RayPairs) -> Intersection:
    """Points of a model from the rays of its two images.

    Parameters
    ----------
    left_from_right : (3, 3) float64
    base : (3,) float64
    rays : RayPairs
        As measured; they are corrected here.
    """
    left, right = corrected(left_from_right, base, rays)
    w = right @ left_from_right.T
    depth = projection_coefficients(left, w, base)
    xyz = 0.5 * (depth[:, :1] * left + base + depth[:, 1:] * w)
    normal = _normal(np.eye(3), xyz, left[:, 2], rays.left_sigma)
    normal += _normal(left_from_right.T, xyz - base, right[:, 2], rays.right_sigma)
    return Intersection(xyz, inverse_of_normals(normal), depth)


def projection_coefficients(u1: Float, w: Float, base: Float) -> Float:
    """Factors l1, l2 with l1 u1 = b + l2 w for coplanar rays, else of the points where they are nearest.

    Parameters
    ----------
    u1, w : (n, 3) float64
        Ray directions in the same frame.
    base : (3,) float64

    Returns
    -------
    (n, 2) float64, NaN where the rays are parallel
    """
    cross = np.cross(u1, w)
    square = np.einsum("ni,ni->n", cross, cross)
    lengths = np.einsum("ni,ni->n", u1, u1) * np.einsum("ni,ni->n", w, w)
    square = np.where(square > PARALLEL * lengths, square, np.nan)
    along = np.stack([np.cross(base, w), np.cross(base, u1)], axis=1)
    return np.asarray(np.einsum("nki,ni->nk", along, cross) / square[:, None])


def intersect_rays(X0: Float, directions: Float, point_row: Int, n_points: int) -> Float:
    """Points nearest to all their rays, any number of rays per point.

    Parameters
    ----------
    X0 : (n, 3) float64
        Projection centre of each ray.
    directions : (n, 3) float64
        Direction of each ray, any length.
    point_row : (n,) int
        Point of each ray, 0 to n_points - 1.

    Returns
    -------
    (n_points, 3) float64, NaN where the rays do not determine the point

    Examples
    --------
    >>> X0 = np.array([[0.0, 0.0, 10.0], [4.0, 0.0, 10.0]])
    >>> directions = np.array([[1.0, 0.0, -5.0], [-1.0, 0.0, -5.0]])
    >>> intersect_rays(X0, directions, np.array([0, 0]), 1).round(9) + 0.0
    array([[2., 0., 0.]])
    """
    xyz = np.full((n_points, 3), np.nan)
    if not len(X0):
        return xyz
    origin = X0.mean(axis=0)
    u = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    across = np.eye(3) - u[:, :, None] * u[:, None, :]
    normal, right_side = np.zeros((n_points, 3, 3)), np.zeros((n_points, 3))
    np.add.at(normal, point_row, across)
    np.add.at(right_side, point_row, np.einsum("nij,nj->ni", across, X0 - origin))
    values = np.linalg.eigvalsh(normal)
    determined = values[:, 0] > PARALLEL * np.maximum(values[:, 2], 1e-300)
    xyz[determined] = np.linalg.solve(normal[determined], right_side[determined][..., None])[..., 0] + origin
    return xyz


def _normal(image_from_model: Float, X: Float, minus_c: Float, sigma: Float) -> Float:
    """Normal matrices of points from the image coordinates x = c u / -w of one image, (u, v, w) = R' X."""
    u = X @ image_from_model.T
    scale = minus_c / u[:, 2]
    by_frame = np.zeros((len(X), 2, 3))
    by_frame[:, 0, 0] = by_frame[:, 1, 1] = scale
    by_frame[:, :, 2] = -scale[:, None] * u[:, :2] / u[:, 2:]
    J = by_frame @ image_from_model / sigma[:, :, None]
    return np.asarray(J.swapaxes(1, 2) @ J)


def inverse_of_normals(normal: Float) -> Float:
    """Covariances (n, 3, 3) of normal matrices; NaN where they are not finite or singular."""
    inverse = np.full_like(normal, np.nan)
    usable = np.flatnonzero(finite_rows(normal))
    usable = usable[np.linalg.cond(normal[usable]) < 1e15]
    inverse[usable] = np.linalg.inv(normal[usable])
    return inverse
