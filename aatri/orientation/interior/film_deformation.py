"""What an affine interior orientation says about the film: its turn, its deformation, how well it predicts a mark.

A is the linear part of the transformation of nominal millimetres into photo coordinates, (2, 2). Its nearest rotation Q
has the angle

    atan2(a21 - a12, a11 + a22);

what remains, I - Q A^-1 applied to a photo coordinate, is the film deformation that A takes out. Shear and unequal
scales are read from A'A: its off-diagonal element is the shear, half the difference of its diagonal that of the scales.
"""

from __future__ import annotations

import numpy as np

from aatri.arrays import Float


def turn_rad(photo_from_nominal: Float) -> Float:
    """Angle of the nearest rotation.

    Parameters
    ----------
    photo_from_nominal : (n, 2, 2) float64

    Returns
    -------
    (n,) float64, rad
    """
    A = photo_from_nominal
    return np.arctan2(A[:, 1, 0] - A[:, 0, 1], A[:, 0, 0] + A[:, 1, 1])


def deformation(photo_from_nominal: Float) -> Float:
    """Film deformation per photo coordinate: the affine transformation minus its rotation alone.

    Parameters
    ----------
    photo_from_nominal : (n, 2, 2) float64

    Returns
    -------
    (n, 2, 2) float64
    """
    angle = turn_rad(photo_from_nominal)
    cos, sin = np.cos(angle), np.sin(angle)
    rotation = np.stack([np.stack([cos, -sin], axis=-1), np.stack([sin, cos], axis=-1)], axis=-2)
    return np.asarray(np.eye(2) - rotation @ np.linalg.inv(photo_from_nominal))


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


def prediction_sigma_mm(covariance: Float, xy_mm: Float, sigma_mm: Float) -> Float:
    """Standard deviation, mean of x and y, of a mark that took no part minus the transformation there.

    Parameters
    ----------
    covariance : (n, 6, 6) float64
        Of the transformation's parameters (1, x, y) in x, then in y.
    xy_mm, sigma_mm : (n, 2) float64, mm
        Calibrated place and standard deviation of the measurement.

    Returns
    -------
    (n,) float64, mm
    """
    basis = np.column_stack([np.ones(len(xy_mm)), xy_mm])
    of_x = np.einsum("ni,nij,nj->n", basis, covariance[:, :3, :3], basis)
    of_y = np.einsum("ni,nij,nj->n", basis, covariance[:, 3:, 3:], basis)
    return np.asarray(np.sqrt((sigma_mm**2).mean(axis=1) + (of_x + of_y) / 2))
