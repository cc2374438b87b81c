"""Rotations: matrices, their angles in both systems, and the exponential map.

`R` maps image to ground: X - X0 = lambda R (x, y, -c). Angles (docs/formulas.md 1.1):

- omega-phi-kappa (international): R = Rx(omega) Ry(phi) Rz(kappa)
- phi-omega-kappa (Chinese): R = Ry(-phi) Rx(omega) Rz(kappa); there a3 = -sin(phi) cos(omega), so that a positive phi
  turns the other way about Y than in the international system
- roll-pitch-heading is that of the carrier and needs the mount; it is not converted here.

Increments are on the ground side: R <- exp([d]x) R.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float

AngleSystem = Literal["omega-phi-kappa", "phi-omega-kappa"]


def _axis(angle_rad: npt.ArrayLike, axis: int) -> Float:
    angle = np.asarray(angle_rad, dtype=np.float64)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    matrix = np.zeros((*angle.shape, 3, 3))
    matrix[..., axis, axis] = 1.0
    matrix[..., i, i] = matrix[..., j, j] = np.cos(angle)
    matrix[..., j, i] = np.sin(angle)
    matrix[..., i, j] = -np.sin(angle)
    return matrix


def rotation_from_angles(angles_rad: npt.ArrayLike, system: AngleSystem = "omega-phi-kappa") -> Float:
    """Rotation matrix of three angles, in the order the system's name says.

    Parameters
    ----------
    angles_rad : (..., 3) float64, rad
    system : str

    Returns
    -------
    (..., 3, 3) float64
    """
    a = np.asarray(angles_rad, dtype=np.float64)
    if system == "omega-phi-kappa":
        return _axis(a[..., 0], 0) @ _axis(a[..., 1], 1) @ _axis(a[..., 2], 2)
    return _axis(-a[..., 0], 1) @ _axis(a[..., 1], 0) @ _axis(a[..., 2], 2)


def angles_from_rotation(rotation: npt.ArrayLike, system: AngleSystem = "omega-phi-kappa") -> Float:
    """The angles of a rotation matrix; the inverse of `rotation_from_angles`.

    The middle angle is in [-pi/2, pi/2]; at its ends the first angle is 0.

    Parameters
    ----------
    rotation : (..., 3, 3) float64

    Returns
    -------
    (..., 3) float64, rad
    """
    R = np.asarray(rotation, dtype=np.float64)
    if system == "omega-phi-kappa":
        c = np.hypot(R[..., 0, 0], R[..., 0, 1])
        first, middle = np.arctan2(-R[..., 1, 2], R[..., 2, 2]), np.arctan2(R[..., 0, 2], c)
        third = np.arctan2(-R[..., 0, 1], R[..., 0, 0])
        locked = np.arctan2(R[..., 1, 0], R[..., 1, 1])
    else:
        c = np.hypot(R[..., 1, 0], R[..., 1, 1])
        first, middle = np.arctan2(-R[..., 0, 2], R[..., 2, 2]), np.arctan2(-R[..., 1, 2], c)
        third = np.arctan2(R[..., 1, 0], R[..., 1, 1])
        locked = np.arctan2(-R[..., 0, 1], R[..., 0, 0])
    at_pole = c < 1e-12
    return np.stack([np.where(at_pole, 0.0, first), middle, np.where(at_pole, locked, third)], axis=-1)


def skew(v: npt.ArrayLike) -> Float:
    """Matrix [v]x with [v]x w = v x w."""
    v = np.asarray(v)
    matrix = np.zeros((*v.shape, 3), dtype=v.dtype)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        matrix[..., k, j] = v[..., i]
        matrix[..., j, k] = -v[..., i]
    return matrix


def exp_rotation(d_rad: npt.ArrayLike) -> Float:
    """Rotation matrix exp([d]x) of a rotation vector (Rodrigues), exact for small and large angles.

    Parameters
    ----------
    d_rad : (..., 3) float64, rad
    """
    d = np.asarray(d_rad, dtype=np.float64)
    angle = np.linalg.norm(d, axis=-1)[..., None, None]
    half = np.sinc(angle / (2 * np.pi))
    K = skew(d)
    return np.asarray(np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * half**2 * (K @ K))


def log_rotation(rotation: npt.ArrayLike) -> Float:
    """Rotation vector of a matrix, angle in [0, pi]; the inverse of `exp_rotation`.

    Parameters
    ----------
    rotation : (..., 3, 3) float64

    Returns
    -------
    (..., 3) float64, rad
    """
    from scipy.spatial.transform import Rotation

    R = np.asarray(rotation, dtype=np.float64)
    return np.asarray(Rotation.from_matrix(R.reshape(-1, 3, 3)).as_rotvec(), dtype=np.float64).reshape(R.shape[:-1])


def nearest_rotation(matrix: npt.ArrayLike) -> Float:
    """The rotation nearest to a 3x3 matrix (Frobenius norm), by SVD.

    Parameters
    ----------
    matrix : (..., 3, 3) float64
    """
    u, _, vt = np.linalg.svd(np.asarray(matrix, dtype=np.float64))
    u = u.copy()
    u[..., :, 2] *= np.sign(np.linalg.det(u @ vt))[..., None]
    return np.asarray(u @ vt)


def angle_covariance(rotation: npt.ArrayLike, covariance: npt.ArrayLike, system: AngleSystem) -> Float:
    """Covariance of the three angles from that of the ground-side increment d (R <- exp([d]x) R).

    For R = A1(t1) A2(t2) A3(t3) a change of the angles turns about a1, A1 a2 and A1 A2 a3: d = G dt.

    Parameters
    ----------
    rotation : (n, 3, 3) float64
    covariance : (n, 3, 3) float64, rad^2
    system : str

    Returns
    -------
    (n, 3, 3) float64, rad^2
    """
    angles = angles_from_rotation(rotation, system)
    zero, one = np.zeros(len(angles)), np.ones(len(angles))
    if system == "omega-phi-kappa":
        first = _axis(angles[:, 0], 0)
        a1, a2 = np.stack([one, zero, zero], -1), first[..., :, 1]
        a3 = (first @ _axis(angles[:, 1], 1))[..., :, 2]
    else:
        first = _axis(-angles[:, 0], 1)
        a1, a2 = np.stack([zero, -one, zero], -1), first[..., :, 0]
        a3 = (first @ _axis(angles[:, 1], 0))[..., :, 2]
    G_inverse = np.linalg.pinv(np.stack([a1, a2, a3], axis=-1))
    return np.asarray(G_inverse @ np.asarray(covariance) @ G_inverse.swapaxes(-1, -2))


def levelling(up: Float) -> Float:
    """The smallest rotation that turns a direction to Z, (3, 3).

    Parameters
    ----------
    up : (3,) float64
        Of any length but zero.
    """
    u = up / np.linalg.norm(up)
    # For u opposite to Z any half turn about a horizontal axis does.
    if u[2] < -1 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    # 1 + u_Z without cancellation, where u is nearly opposite
    v = np.array([u[0], u[1], 1.0 + u[2] if u[2] > 0 else (u[0] ** 2 + u[1] ** 2) / (1.0 - u[2])])
    return np.asarray(np.diag([-1.0, -1.0, 1.0]) @ (2 * np.outer(v, v) / (v @ v) - np.eye(3)))
