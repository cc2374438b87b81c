"""Coplanarity of the base and the two rays of a point, with exact derivatives.

    F = b . (u1 x R u2) = u1' E u2,   E = -[b]x R,   u = (x, y, -c)

b is the base from the left to the right projection centre in the frame of the left image, R turns directions of the
right image into that frame. F = 0 if base and rays lie in one plane. Unknowns p are the rotation increment d
(R <- exp([d]x) R) and the turn t of the base along its tangents T (b <- b + T t):

    dE/dd_k = -[b]x [e_k]x R,   dE/dt_k = -[T_k]x R

The distance from coplanarity is F over its standard deviation (Sampson distance),

    s_F^2 = sum over x1 y1 x2 y2 of (dF/dl s_l)^2,   dF/du1 = E u2,   dF/du2 = E' u1

and the y-parallax p = F / |dF/d(x2, y2)|: how far the right image point lies beside its epipolar line, in mm.

Source: docs/formulas.md 3.1; Hartley & Zisserman, Multiple View Geometry, 11.4.3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from aatri.arrays import Bool, Float, Int
from aatri.geometry.rotations import skew

_AXES = skew(np.eye(3))


@dataclass(frozen=True)
class RayPairs:
    """Rays of the same points in two images."""

    left: Float
    right: Float
    """(n, 3), mm. (x, y, -c) in the left and right image."""
    left_sigma: Float
    right_sigma: Float
    """(n, 2), mm. Standard deviations of x and y."""

    def take(self, rows: Bool | Int | slice) -> RayPairs:
        """The rays of the chosen points."""
        return RayPairs(self.left[rows], self.right[rows], self.left_sigma[rows], self.right_sigma[rows])


def essential_matrix(left_from_right: npt.ArrayLike, base: npt.ArrayLike) -> Float:
    """E = -[b]x R, so that F = u1' E u2.

    Parameters
    ----------
    left_from_right : (..., 3, 3) float64
    base : (..., 3) float64

    Examples
    --------
    Two points of one epipolar line, of images side by side:

    >>> E = essential_matrix(np.eye(3), [1.0, 0.0, 0.0])
    >>> float(np.array([10.0, 5.0, -150.0]) @ E @ [-80.0, 5.0, -150.0])
    0.0
    """
    return np.asarray(-skew(base) @ np.asarray(left_from_right))


def essential_derivatives(left_from_right: Float, base: Float, directions: Float) -> Float:
    """Derivatives of E by the rotation increment and by a displacement of the base along given directions.

    Parameters
    ----------
    left_from_right : (3, 3) float64
    base : (3,) float64
    directions : (3, k) float64

    Returns
    -------
    (3 + k, 3, 3) float64
    """
    by_rotation = -skew(base) @ _AXES @ left_from_right
    by_base = -skew(directions.T) @ left_from_right
    return np.concatenate([by_rotation, by_base])


def coplanarity(E: Float, left: Float, right: Float) -> tuple[Float, Float]:
    """F and its derivatives by the four image coordinates.

    Parameters
    ----------
    E : (3, 3) float64
    left, right : (n, 3) float64, mm

    Returns
    -------
    F : (n,) float64
    gradient : (n, 4) float64
        By x1, y1, x2, y2.
    """
    of_left, of_right = right @ E.T, left @ E
    return np.einsum("ni,ni->n", left, of_left), np.concatenate([of_left[:, :2], of_right[:, :2]], axis=1)


def coplanarity_derivatives(dE: Float, left: Float, right: Float) -> tuple[Float, Float]:
    """Derivatives of F and of its gradient by the unknowns.

    Parameters
    ----------
    dE : (u, 3, 3) float64
        From `essential_derivatives`.

    Returns
    -------
    dF : (n, u) float64
    d_gradient : (n, 4, u) float64
    """
    of_left, of_right = right @ dE.swapaxes(1, 2), left @ dE
    dF = np.einsum("ni,uni->nu", left, of_left)
    return dF, np.concatenate([of_left[:, :, :2], of_right[:, :, :2]], axis=2).transpose(1, 2, 0)


def sampson(left_from_right: Float, base: Float, directions: Float, rays: RayPairs) -> tuple[Float, Float]:
    """Sampson distance v = -F / s_F of every point and its exact derivatives: the change of s_F is part of them.

    The sign is that of a residual, computed minus observed: v is negative where the y-parallax is positive.

    Returns
    -------
    v : (n,) float64
    J : (n, 3 + k) float64
        By the rotation increment and the base's displacement along `directions` (3, k).
    """
    F, gradient = coplanarity(essential_matrix(left_from_right, base), rays.left, rays.right)
    dF, d_gradient = coplanarity_derivatives(
        essential_derivatives(left_from_right, base, directions), rays.left, rays.right
    )
    variance = _variances(rays)
    weighted = gradient * variance
    s_F = np.sqrt(np.einsum("ni,ni->n", weighted, gradient))
    ds_F = np.einsum("ni,niu->nu", weighted, d_gradient) / s_F[:, None]
    v = -F / s_F
    return v, -(dF + v[:, None] * ds_F) / s_F[:, None]


def parallax(left_from_right: Float, base: Float, rays: RayPairs) -> tuple[Float, Float]:
    """y-parallax of every point in the right image and its standard deviation, both in mm.

    Positive if the right image point lies on the side of its epipolar line to which dF/d(x2, y2) points; for a base
    along +x and parallel images that is y2 - y1.

    Returns
    -------
    parallax_mm : (n,) float64
    sigma_mm : (n,) float64
    """
    F, gradient = coplanarity(essential_matrix(left_from_right, base), rays.left, rays.right)
    s_F = np.sqrt(np.einsum("ni,ni->n", gradient * _variances(rays), gradient))
    slope = np.hypot(gradient[:, 2], gradient[:, 3])
    return F / slope, s_F / slope


def corrected(left_from_right: Float, base: Float, rays: RayPairs, *, steps: int = 2) -> tuple[Float, Float]:
    """Rays after the smallest weighted correction of the image coordinates that makes them coplanar with the base.

    Each step is the first-order optimal correction -F S g / (g' S g), g the gradient and S the variances; a second
    step takes what the first leaves.

    Returns
    -------
    left, right : (n, 3) float64, mm
    """
    E, variance = essential_matrix(left_from_right, base), _variances(rays)
    left, right = rays.left, rays.right
    for _ in range(steps):
        F, gradient = coplanarity(E, left, right)
        change = -(F / np.einsum("ni,ni->n", gradient * variance, gradient))[:, None] * gradient * variance
        left, right = left.copy(), right.copy()
        left[:, :2] += change[:, :2]
        right[:, :2] += change[:, 2:]
    return left, right


def _variances(rays: RayPairs) -> Float:
    return np.concatenate([rays.left_sigma, rays.right_sigma], axis=1) ** 2
