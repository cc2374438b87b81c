"""What an interior orientation says about the film: its turn, its deformation, how well it predicts a mark.

A is the linear part of the transformation of nominal millimetres into photo coordinates, (2, 2). Its nearest rotation Q
has the angle

    atan2(a21 - a12, a11 + a22).

Shear and unequal scales are read from A'A: its off-diagonal element is the shear, half the difference of its diagonal
that of the scales. The film itself, A^-1 = Q (sx, k; 0, sy), has grown by sx along x and sy along y, and its y axis
leans by the angle k / sy.
"""

import numpy as np

from aatri.arrays import Float
from aatri.geometry.plane_transformations import plane_jacobian, transform_plane

CENTRES = 5
"""Newton steps to the fiducial centre; film is affine to a few parts in a thousand."""


def turn_rad(photo_from_nominal: Float) -> Float:
    """Angle of the nearest rotation.

    Parameters
    ----------
    photo_from_nominal : (n, 2, 2) float64

    Returns
    -------
    (n,) float64, rad

    Examples
    --------
    >>> turn_rad(np.array([[[0.0, -1.0], [1.0, 0.0]]])).round(6)
    array([1.570796])
    """
    A = photo_from_nominal
    return np.arctan2(A[:, 1, 0] - A[:, 0, 1], A[:, 0, 0] + A[:, 1, 1])


def shear_or_stretch(photo_from_nominal: Float) -> Float:
    """The larger of the shear and half the difference of the squared scales in x and y.

    Parameters
    ----------
    photo_from_nominal : (n, 2, 2) float64

    Returns
    -------
    (n,) float64
    """
    gram = photo_from_nominal.swapaxes(1, 2) @ photo_from_nominal
    return np.asarray(np.maximum(np.abs(gram[:, 0, 1]), np.abs(gram[:, 0, 0] - gram[:, 1, 1]) / 2))


def scales_and_shear(photo_from_nominal: Float) -> tuple[Float, Float]:
    """Scales of the film along x and y, (n, 2), and its shear, (n,), rad.

    Parameters
    ----------
    photo_from_nominal : (n, 2, 2) float64
    """
    film = np.linalg.inv(photo_from_nominal)
    sx = np.sqrt((film[:, :, 0] ** 2).sum(axis=1))
    along = film[:, :, 0] / sx[:, None]
    k = (along * film[:, :, 1]).sum(axis=1)
    sy = along[:, 0] * film[:, 1, 1] - along[:, 1] * film[:, 0, 1]
    return np.stack([sx, sy], axis=1), np.arctan2(k, sy)


def prediction_sigma_mm(K: Float, covariance: Float, sigma_mm: Float) -> Float:
    """Standard deviation, mean of x and y, of a mark that took no part minus the transformation there.

    Parameters
    ----------
    K : (n, 2, s) float64
        Corrections the transformation leaves open, at the calibrated place.
    covariance : (n, s, s) float64
        Of their parameters.
    sigma_mm : (n, 2) float64, mm
        Of the measurement.

    Returns
    -------
    (n,) float64, mm
    """
    predicted = np.einsum("nki,nij,nkj->nk", K, covariance, K)
    return np.asarray(np.sqrt((sigma_mm**2 + predicted).mean(axis=1)))


def without_deformation(model: str, matrix: Float, terms: Float, photo_from_nominal: Float, nominal: Float) -> Float:
    """Transformations that only turn, at nominal scale, and agree with those given at the fiducial centre.

    Parameters
    ----------
    model, matrix, terms
        Of n images, see `geometry.plane_transformations`.
    photo_from_nominal : (n, 2, 2) float64
    nominal : (n, 2) float64, mm per unit
        Size of the measured units.

    Returns
    -------
    (n, 2, 3) float64
    """
    centre = np.zeros((len(matrix), 1, 2))
    centre[:, 0] = np.linalg.solve(matrix[:, :, :2], -matrix[:, :, 2:])[:, :, 0]
    for _ in range(CENTRES):
        J = plane_jacobian(model, matrix, terms, centre)[:, 0]
        miss = transform_plane(model, matrix, terms, centre)[:, 0]
        centre[:, 0] -= np.linalg.solve(J, miss[:, :, None])[:, :, 0]
    angle = turn_rad(photo_from_nominal)
    cos, sin = np.cos(angle), np.sin(angle)
    turned = np.stack([np.stack([cos, -sin], axis=-1), np.stack([sin, cos], axis=-1)], axis=-2) * nominal[:, None, :]
    return np.concatenate([turned, -turned @ centre.swapaxes(1, 2)], axis=2)
