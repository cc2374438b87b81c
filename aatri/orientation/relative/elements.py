"""Elements of relative orientation, as each method has them, with their standard deviations.

The orientation of a pair is R (directions of the right image to the frame of the left one) and the unit base b. The
Chinese system phi-omega-kappa has phi first, about -Y.

    dependent     phi2, omega2, kappa2 of R;  mu = by / bx, nu = bz / bx
    independent   the frame has its X axis along the base: b = R1' (1, 0, 0)', R1 = R(phi1, 0, kappa1), R2 = R1 R

        phi1 = asin(-bz),  kappa1 = atan2(-by, bx);  phi2, omega2, kappa2 of R2

The notes have x along the flight. Where the camera is mounted across, |by| > |bx|, by / bx would say nothing: the axes
of both images are then turned by a quarter about z, X = y, Y = -x for by > 0 and the other way round for by < 0
(`along_track`), and the elements of the dependent method are those of these axes.

Both are parameters of the same orientation: least squares finds the same model with either, and the standard deviations
of one follow from those of the other by their derivatives. With the increments d and t of the adjustment
(R <- exp([d]x) R, b <- b + T t) the left image turns by w = W t and the right one by w + R1 d.

Source: docs/formulas.md 3.2, 3.3 (the notes' continuous and single-pair methods).
"""

import numpy as np

from aatri.arrays import Float, diagonals
from aatri.geometry.rotations import angle_covariance, angles_from_rotation, rotation_from_angles
from aatri.geometry.vectors import tangents

DEPENDENT = ("phi2", "omega2", "kappa2", "by/bx", "bz/bx")
INDEPENDENT = ("phi1", "kappa1", "phi2", "omega2", "kappa2")
"""Names of the five elements, angles in rad."""


def dependent_elements(left_from_right: Float, base: Float, covariance: Float) -> tuple[Float, Float]:
    """phi2, omega2, kappa2, by/bx, bz/bx and their standard deviations.

    Parameters
    ----------
    left_from_right : (m, 3, 3) float64
    base : (m, 3) float64
    covariance : (m, 5, 5) float64, rad^2
        Of d and t.

    Returns
    -------
    values, sigma : (m, 5) float64, rad and 1
    """
    Q = along_track(base)
    R, T, base = Q @ left_from_right @ Q.swapaxes(1, 2), Q @ tangents(base), (Q @ base[:, :, None])[:, :, 0]
    angles = angles_from_rotation(R, "phi-omega-kappa")
    of_angles = angle_covariance(R, Q @ covariance[:, :3, :3] @ Q.swapaxes(1, 2), "phi-omega-kappa")
    slopes = base[:, 1:] / base[:, :1]
    by_t = (T[:, 1:] - slopes[:, :, None] * T[:, :1]) / base[:, :1, None]
    of_slopes = by_t @ covariance[:, 3:, 3:] @ by_t.swapaxes(1, 2)
    variances = np.concatenate([diagonals(of_angles), diagonals(of_slopes)], axis=1)
    return np.concatenate([angles, slopes], axis=1), np.sqrt(variances)


def along_track(base: Float) -> Float:
    """Turns (m, 3, 3) about z by a quarter, or none, after which the base is nearer to the X axis than to Y."""
    turned = np.where(np.abs(base[:, 1]) > np.abs(base[:, 0]), np.sign(base[:, 1]), 0.0)
    derivatives = np.zeros((len(base), 3, 3))
    derivatives[:, 0, 0] = derivatives[:, 1, 1] = 1.0 - np.abs(turned)
    derivatives[:, 0, 1], derivatives[:, 1, 0], derivatives[:, 2, 2] = turned, -turned, 1.0
    return derivatives


def independent_elements(left_from_right: Float, base: Float, covariance: Float) -> tuple[Float, Float]:
    """phi1, kappa1, phi2, omega2, kappa2 and their standard deviations; see `dependent_elements`."""
    R1 = left_rotation(base)
    T = tangents(base)
    of_left = left_angle_rates(base) @ T
    R2 = R1 @ left_from_right
    J = np.zeros((len(base), 3, 5))
    J[:, :, :3] = R1
    J[:, :, 3:] = turn_of_left(base) @ T
    of_right = angle_covariance(R2, J @ covariance @ J.swapaxes(1, 2), "phi-omega-kappa")
    left = angles_from_rotation(R1, "phi-omega-kappa")[:, [0, 2]]
    values = np.concatenate([left, angles_from_rotation(R2, "phi-omega-kappa")], axis=1)
    of_left = of_left @ covariance[:, 3:, 3:] @ of_left.swapaxes(1, 2)
    return values, np.sqrt(np.concatenate([diagonals(of_left), diagonals(of_right)], axis=1))


def left_rotation(base: Float) -> Float:
    """R1 of the independent method, (m, 3, 3): turns directions of the left image into the frame along the base."""
    zero = np.zeros(len(base))
    angles = np.stack([np.arcsin(-base[:, 2]), zero, np.arctan2(-base[:, 1], base[:, 0])], axis=1)
    return rotation_from_angles(angles, "phi-omega-kappa")


def left_angle_rates(base: Float) -> Float:
    """Derivatives (m, 2, 3) of phi1 and kappa1 to the base."""
    derivatives = np.zeros((len(base), 2, 3))
    flat = base[:, 0] ** 2 + base[:, 1] ** 2
    derivatives[:, 0, 2] = -1.0 / np.sqrt(flat)
    derivatives[:, 1, 0], derivatives[:, 1, 1] = base[:, 1] / flat, -base[:, 0] / flat
    return derivatives


def turn_of_left(base: Float) -> Float:
    """How R1 turns with the base, (m, 3, 3): R1 <- exp([W db]x) R1."""
    phi = np.arcsin(-base[:, 2])
    axes = np.zeros((len(base), 3, 2))
    axes[:, 1, 0] = -1.0  # phi turns about -Y
    axes[:, 0, 1], axes[:, 2, 1] = -np.sin(phi), np.cos(phi)  # kappa about the third axis of R(phi)
    return np.asarray(axes @ left_angle_rates(base))
