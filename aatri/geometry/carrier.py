"""Attitude of a carrier: roll, pitch and heading, the mount of its camera, and rotation vectors with their Jacobians.

    R_ned_body = Rz(heading) Ry(pitch) Rx(roll)        body: x forward, y right, z down
    R_body_camera = Rz(mount) diag(1, -1, -1)          image x clockwise from the nose, y to its left, z up

Rotation vectors w and matrices E = exp([w]x) are converted by series that hold for complex numbers too, so that
derivatives can be checked by complex step. The left Jacobian J tells exp([w + dw]x) = exp([J dw]x) exp([w]x):

    J(w) = I + (1 - cos t) / t^2 [w]x + (t - sin t) / t^3 [w]x^2,    t = |w|

Source: Sola 2018, A micro Lie theory; Baeumker and Heimes 2001.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float

SMALL = 1e-3
"""Angles, rad, below which series stand for the closed forms."""


def _turn(angle: npt.NDArray[Any], axis: int) -> npt.NDArray[Any]:
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    matrix = np.zeros((len(angle), 3, 3))
    matrix[:, axis, axis] = 1.0
    matrix[:, i, i] = matrix[:, j, j] = np.cos(angle)
    matrix[:, j, i], matrix[:, i, j] = np.sin(angle), -np.sin(angle)
    return matrix


def angle_axes(angles_rad: Float, system: str) -> tuple[Float, Float]:
    """The rotation of three angles, and the axes about which each of them turns it from the left.

    Parameters
    ----------
    angles_rad : (n, 3) float64, rad
    system : str
        omega-phi-kappa, phi-omega-kappa or roll-pitch-heading.

    Returns
    -------
    rotation : (n, 3, 3) float64
    axes : (n, 3, 3) float64
        Columns G: a change da of the angles turns by exp([G da]x).
    """
    order, sign = {
        "omega-phi-kappa": ((0, 1, 2), (1, 1, 1)),
        "phi-omega-kappa": ((1, 0, 2), (-1, 1, 1)),
        "roll-pitch-heading": ((2, 1, 0), (1, 1, 1)),
    }[system]
    listed = angles_rad[:, ::-1] if system == "roll-pitch-heading" else angles_rad
    rotation = np.broadcast_to(np.eye(3), (len(listed), 3, 3))
    columns = []
    for k, axis in enumerate(order):
        columns.append(sign[k] * rotation[:, :, axis])
        rotation = rotation @ _turn(sign[k] * listed[:, k], axis)
    if system == "roll-pitch-heading":
        columns = columns[::-1]
    return rotation, np.stack(columns, axis=-1)


def carrier_angles(rotation: Float) -> Float:
    """Roll, pitch and heading (n, 3), rad, of R_ned_body; the inverse of `angle_axes`. Pitch is in [-pi/2, pi/2]."""
    R = rotation
    level = np.hypot(R[:, 0, 0], R[:, 1, 0])
    roll, heading = np.arctan2(R[:, 2, 1], R[:, 2, 2]), np.arctan2(R[:, 1, 0], R[:, 0, 0])
    return np.stack([roll, np.arctan2(-R[:, 2, 0], level), heading], axis=1)


def body_from_mount(mount_deg: npt.ArrayLike) -> Float:
    """The body of the carrier from the axes of its camera, (n, 3, 3)."""
    return np.asarray(_turn(np.radians(np.asarray(mount_deg, dtype=np.float64)), 2) @ np.diag([1.0, -1.0, -1.0]))


def _cross(w: npt.NDArray[Any]) -> npt.NDArray[Any]:
    matrix = np.zeros((len(w), 3, 3), dtype=w.dtype)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        matrix[:, k, j], matrix[:, j, k] = w[:, i], -w[:, i]
    return matrix


def _coefficients(w: npt.NDArray[Any]) -> tuple[Any, Any, Any]:
    """sin t / t, (1 - cos t) / t^2 and (t - sin t) / t^3, (n, 1, 1)."""
    t2 = (w * w).sum(axis=1)
    small = np.abs(t2) < SMALL**2
    t = np.sqrt(np.where(small, 1.0, t2))
    a = np.where(small, 1 - t2 / 6 + t2 * t2 / 120, np.sin(t) / t)
    b = np.where(small, 0.5 - t2 / 24 + t2 * t2 / 720, (1 - np.cos(t)) / (t * t))
    c = np.where(small, 1 / 6 - t2 / 120 + t2 * t2 / 5040, (t - np.sin(t)) / t**3)
    return a[:, None, None], b[:, None, None], c[:, None, None]


def exp_matrix(w: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """exp([w]x) of rotation vectors (n, 3), real or complex."""
    a, b, _ = _coefficients(w)
    K = _cross(w)
    return np.asarray(np.eye(3) + a * K + b * (K @ K))


def left_jacobian(w: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """J of rotation vectors, (n, 3, 3)."""
    _, b, c = _coefficients(w)
    K = _cross(w)
    return np.asarray(np.eye(3) + b * K + c * (K @ K))


def log_vector(rotation: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Rotation vectors of matrices (n, 3, 3), real or complex, by their quaternion: q0 >= 0, angles up to pi."""
    R = rotation
    trace = R[:, 0, 0] + R[:, 1, 1] + R[:, 2, 2]
    four = np.stack([1 + trace, *(1 + 2 * R[:, k, k] - trace for k in range(3))], axis=1)
    largest = np.argmax(four.real, axis=1)
    q = np.empty((len(R), 4), dtype=R.dtype)
    for k in range(4):
        mine = largest == k
        S, d = R[mine], np.sqrt(four[mine, k])
        odd = np.stack([S[:, 2, 1] - S[:, 1, 2], S[:, 0, 2] - S[:, 2, 0], S[:, 1, 0] - S[:, 0, 1]], axis=1)
        if k == 0:
            q[mine] = 0.5 * np.column_stack([d, odd / d[:, None]])
            continue
        j = k - 1
        even = S[:, j, :] + S[:, :, j]
        even[:, j] = d * d
        q[mine] = 0.5 * np.column_stack([odd[:, j] / d, even / d[:, None]])
    q = q * np.where(q[:, :1].real < 0, -1.0, 1.0)
    s2 = (q[:, 1:] ** 2).sum(axis=1)
    small = np.abs(s2) < SMALL**2
    s = np.sqrt(np.where(small, 1.0, s2))
    with np.errstate(divide="ignore", invalid="ignore"):
        half = np.where(s.real > q[:, 0].real, np.pi / 2 - np.arctan(q[:, 0] / s), np.arctan(s / q[:, 0]))
        ratio = s2 / q[:, 0] ** 2
        factor = np.where(small, 2 / q[:, 0] * (1 - ratio / 3 + ratio**2 / 5), 2 * half / s)
    return np.asarray(q[:, 1:] * factor[:, None])
