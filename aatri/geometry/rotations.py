"""Rotations: matrices, their angles in three systems, and the exponential map.

`R` maps image to ground: X - X0 = lambda R (x, y, -c). Angles (docs/formulas.md 1.1):

- omega-phi-kappa (international): R = Rx(omega) Ry(phi) Rz(kappa)
- phi-omega-kappa (Chinese): R = Ry(-phi) Rx(omega) Rz(kappa); there a3 = -sin(phi) cos(omega), so that a positive phi
  turns the other way about Y than in the international system
- roll-pitch-heading, of a carrier: R_ned_body = Rz(heading) Ry(pitch) Rx(roll), body: x forward, y right, z down. The
  mount of the camera tells the rest: R_body_camera = Rz(mount) diag(1, -1, -1), image x clockwise from the nose, y to
  its left, z up

Increments are on the ground side: R <- exp([d]x) R. The left Jacobian J tells exp([w + dw]x) = exp([J dw]x) exp([w]x):

    J(w) = I + (1 - cos t) / t^2 [w]x + (t - sin t) / t^3 [w]x^2,    t = |w|

Exponential map, logarithm and Jacobian hold for complex numbers too: derivatives can be checked by complex step.

Source: Sola 2018, A micro Lie theory; Baeumker and Heimes 2001.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float

_ORDER = {
    "omega-phi-kappa": ((0, 0, 1), (1, 1, 1), (2, 2, 1)),
    "phi-omega-kappa": ((0, 1, -1), (1, 0, 1), (2, 2, 1)),
    "roll-pitch-heading": ((2, 2, 1), (1, 1, 1), (0, 0, 1)),
}
"""Factors of R from the left: which of the three angles, its axis, its sign."""

SMALL = 1e-3
"""Angles, rad, below which series stand for the closed forms."""


def _axis(angle_rad: npt.ArrayLike, axis: int) -> Float:
    angle = np.asarray(angle_rad, dtype=np.float64)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    matrix = np.zeros((*angle.shape, 3, 3))
    matrix[..., axis, axis] = 1.0
    matrix[..., i, i] = matrix[..., j, j] = np.cos(angle)
    matrix[..., j, i] = np.sin(angle)
    matrix[..., i, j] = -np.sin(angle)
    return matrix


def rotation_from_angles(angles_rad: npt.ArrayLike, system: str = "omega-phi-kappa") -> Float:
    """Rotation matrix of three angles, in the order the system's name says.

    Parameters
    ----------
    angles_rad : (..., 3) float64, rad
    system : str
        omega-phi-kappa, phi-omega-kappa or roll-pitch-heading.

    Returns
    -------
    (..., 3, 3) float64

    Examples
    --------
    >>> rotation_from_angles([0.0, 0.0, np.pi / 2]).round(3) + 0.0
    array([[ 0., -1.,  0.],
           [ 1.,  0.,  0.],
           [ 0.,  0.,  1.]])
    """
    return angle_axes(angles_rad, system)[0]


def angle_axes(angles_rad: npt.ArrayLike, system: str) -> tuple[Float, Float]:
    """The rotation of three angles, and the axes about which each of them turns it from the left.

    Parameters
    ----------
    angles_rad : (..., 3) float64, rad
    system : str
        omega-phi-kappa, phi-omega-kappa or roll-pitch-heading.

    Returns
    -------
    rotation : (..., 3, 3) float64
    axes : (..., 3, 3) float64
        Columns G: a change da of the angles turns by exp([G da]x).
    """
    angles = np.asarray(angles_rad, dtype=np.float64)
    rotation, axes = np.broadcast_to(np.eye(3), (*angles.shape, 3)), np.empty((*angles.shape, 3))
    for k, axis, sign in _ORDER[system]:
        axes[..., k] = sign * rotation[..., axis]
        rotation = rotation @ _axis(sign * angles[..., k], axis)
    return rotation, axes


def angles_from_rotation(rotation: npt.ArrayLike, system: str = "omega-phi-kappa") -> Float:
    """The angles of a rotation matrix; the inverse of `rotation_from_angles`.

    The middle angle is in [-pi/2, pi/2]; at its ends the angle that the system names first is 0.

    Parameters
    ----------
    rotation : (..., 3, 3) float64
    system : str
        omega-phi-kappa, phi-omega-kappa or roll-pitch-heading.

    Returns
    -------
    (..., 3) float64, rad

    Examples
    --------
    >>> turned = rotation_from_angles(np.radians([2.0, -3.0, 90.0]))
    >>> np.degrees(angles_from_rotation(turned)).round(9)
    array([ 2., -3., 90.])
    """
    R = np.asarray(rotation, dtype=np.float64)
    if system == "omega-phi-kappa":
        c = np.hypot(R[..., 0, 0], R[..., 0, 1])
        first, middle = np.arctan2(-R[..., 1, 2], R[..., 2, 2]), np.arctan2(R[..., 0, 2], c)
        third = np.arctan2(-R[..., 0, 1], R[..., 0, 0])
        locked = np.arctan2(R[..., 1, 0], R[..., 1, 1])
    elif system == "phi-omega-kappa":
        c = np.hypot(R[..., 1, 0], R[..., 1, 1])
        first, middle = np.arctan2(-R[..., 0, 2], R[..., 2, 2]), np.arctan2(-R[..., 1, 2], c)
        third = np.arctan2(R[..., 1, 0], R[..., 1, 1])
        locked = np.arctan2(-R[..., 0, 1], R[..., 0, 0])
    else:
        c = np.hypot(R[..., 0, 0], R[..., 1, 0])
        first, middle = np.arctan2(R[..., 2, 1], R[..., 2, 2]), np.arctan2(-R[..., 2, 0], c)
        third = np.arctan2(R[..., 1, 0], R[..., 0, 0])
        locked = np.arctan2(-R[..., 0, 1], R[..., 1, 1])
    at_pole = c < 1e-12
    return np.stack([np.where(at_pole, 0.0, first), middle, np.where(at_pole, locked, third)], axis=-1)


def angle_covariance(rotation: npt.ArrayLike, covariance: npt.ArrayLike, system: str) -> Float:
    """Covariance of the three angles from that of the ground-side increment d (R <- exp([d]x) R), d = G dt.

    Parameters
    ----------
    rotation : (n, 3, 3) float64
    covariance : (n, 3, 3) float64, rad^2
    system : str
        omega-phi-kappa, phi-omega-kappa or roll-pitch-heading.

    Returns
    -------
    (n, 3, 3) float64, rad^2
    """
    G_inverse = np.linalg.pinv(angle_axes(angles_from_rotation(rotation, system), system)[1])
    return np.asarray(G_inverse @ np.asarray(covariance) @ G_inverse.swapaxes(-1, -2))


ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""Axes east, north, up from north, east, down."""


def body_from_mount(mount_deg: npt.ArrayLike) -> Float:
    """The body of the carrier from the axes of its camera, (n, 3, 3)."""
    return np.asarray(_axis(np.radians(np.asarray(mount_deg, dtype=np.float64)), 2) @ np.diag([1.0, -1.0, -1.0]))


def skew(v: npt.ArrayLike) -> Float:
    """Matrix [v]x with [v]x w = v x w.

    Examples
    --------
    >>> skew([1.0, 2.0, 3.0]) @ [0.0, 0.0, 1.0]
    array([ 2., -1.,  0.])
    """
    v = np.asarray(v)
    matrix = np.zeros((*v.shape, 3), dtype=v.dtype)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        matrix[..., k, j] = v[..., i]
        matrix[..., j, k] = -v[..., i]
    return matrix


def exp_rotation(d_rad: npt.ArrayLike) -> npt.NDArray[Any]:
    """Rotation matrix exp([d]x) of a rotation vector (Rodrigues), exact for small and large angles.

    Parameters
    ----------
    d_rad : (..., 3) float64 or complex, rad

    Returns
    -------
    (..., 3, 3) float64 or complex

    Examples
    --------
    >>> (exp_rotation([0.0, 0.0, np.pi / 2]) @ [1.0, 0.0, 0.0]).round(12)
    array([0., 1., 0.])
    """
    d = np.asarray(d_rad)
    angle = np.sqrt((d * d).sum(axis=-1))[..., None, None]
    half = np.sinc(angle / (2 * np.pi))
    K = skew(d)
    return np.asarray(np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * half**2 * (K @ K))


def left_jacobian(w_rad: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """J of rotation vectors (n, 3), real or complex; (n, 3, 3)."""
    t2 = (w_rad * w_rad).sum(axis=1)
    small = np.abs(t2) < SMALL**2
    t = np.sqrt(np.where(small, 1.0, t2))
    b = np.where(small, 0.5 - t2 / 24 + t2 * t2 / 720, (1 - np.cos(t)) / (t * t))
    c = np.where(small, 1 / 6 - t2 / 120 + t2 * t2 / 5040, (t - np.sin(t)) / t**3)
    K = skew(w_rad)
    return np.asarray(np.eye(3) + b[:, None, None] * K + c[:, None, None] * (K @ K))


def log_rotation(rotation: npt.ArrayLike) -> npt.NDArray[Any]:
    """Rotation vector of a matrix, angle in [0, pi], by its quaternion; the inverse of `exp_rotation`.

    Parameters
    ----------
    rotation : (..., 3, 3) float64 or complex

    Returns
    -------
    (..., 3) float64 or complex, rad

    Examples
    --------
    >>> log_rotation(exp_rotation([0.1, -0.2, 0.3])).round(12)
    array([ 0.1, -0.2,  0.3])
    """
    matrices = np.asarray(rotation)
    R = matrices.reshape(-1, 3, 3)
    trace = R[:, 0, 0] + R[:, 1, 1] + R[:, 2, 2]
    four = np.stack([1 + trace, *(1 + 2 * R[:, k, k] - trace for k in range(3))], axis=1)
    largest = np.argmax(four.real, axis=1)
    q = np.empty((len(R), 4), dtype=R.dtype)
    for k in range(4):
        rows = largest == k
        S, d = R[rows], np.sqrt(four[rows, k])
        odd = np.stack([S[:, 2, 1] - S[:, 1, 2], S[:, 0, 2] - S[:, 2, 0], S[:, 1, 0] - S[:, 0, 1]], axis=1)
        if k == 0:
            q[rows] = 0.5 * np.column_stack([d, odd / d[:, None]])
            continue
        j = k - 1
        even = S[:, j, :] + S[:, :, j]
        even[:, j] = d * d
        q[rows] = 0.5 * np.column_stack([odd[:, j] / d, even / d[:, None]])
    q = q * np.where(q[:, :1].real < 0, -1.0, 1.0)
    s2 = (q[:, 1:] ** 2).sum(axis=1)
    small = np.abs(s2) < SMALL**2
    s = np.sqrt(np.where(small, 1.0, s2))
    with np.errstate(divide="ignore", invalid="ignore"):
        half = np.where(s.real > q[:, 0].real, np.pi / 2 - np.arctan(q[:, 0] / s), np.arctan(s / q[:, 0]))
        ratio = s2 / q[:, 0] ** 2
        factor = np.where(small, 2 / q[:, 0] * (1 - ratio / 3 + ratio**2 / 5), 2 * half / s)
    return np.asarray(q[:, 1:] * factor[:, None]).reshape(matrices.shape[:-1])


def angles_between(one: Float, other: Float) -> Float:
    """Angles between rotations, (n,), rad; NaN where one is unknown.

    Parameters
    ----------
    one, other : (n, 3, 3) float64
    """
    angle = np.full(len(one), np.nan)
    both = np.isfinite(one).all(axis=(1, 2)) & np.isfinite(other).all(axis=(1, 2))
    angle[both] = np.linalg.norm(log_rotation(one[both] @ other[both].swapaxes(1, 2)), axis=1)
    return angle


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
