"""Distortion models of other communities: ideal to distorted, in normalised coordinates (principal distance 1).

opencv, with u right and v DOWN as there:

    L   = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)
    u_d = u L + 2 p1 u v + p2 (r^2 + 2 u^2),   v_d = v L + p1 (r^2 + 2 v^2) + 2 p2 u v

polynomial, in the same axes (the frame cameras of Metashape and MicMac):

    L   = 1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8 + k5 r^10 + k6 r^12 + k7 r^14
    u'  = u L + 2 p1 u v + p2 (r^2 + 2 u^2) + a1 u + a2 v,   v_d = v L + p1 (r^2 + 2 v^2) + 2 p2 u v
    u_d = u' + b2 v_d

fisheye (Kannala-Brandt): theta = atan r, r_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8)
bal (Bundler): r_d = r (1 + k1 r^2 + k2 r^4)

Each function returns f (n, 2) and its derivative (n, 2, 2); a parameter is one number, or one per point. The last two
are radial, so that the direction of v does not matter.

Source: OpenCV documentation, calib3d; Agisoft Metashape user manual; MicMac documentation, ModPhgrStd; Kannala &
Brandt 2006; Agarwal et al. 2010.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]
Parameters = Mapping[str, Any]
"""Values by name: a number or an array (n,)."""

PARAMETERS = {
    "opencv": ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    "polynomial": ("k1", "k2", "k3", "k4", "k5", "k6", "k7", "p1", "p2", "a1", "a2", "b2"),
    "fisheye": ("k1", "k2", "k3", "k4"),
    "bal": ("k1", "k2"),
}
"""Names of the parameters of each model."""


def opencv(uv: Array, parameters: Parameters) -> tuple[Array, Array]:
    """Distort after OpenCV, u right and v down."""
    k1, k2, p1, p2, k3, k4, k5, k6 = (parameters.get(name, 0.0) for name in PARAMETERS["opencv"])
    q = (uv**2).sum(axis=1)
    top, bottom = 1 + q * (k1 + q * (k2 + q * k3)), 1 + q * (k4 + q * (k5 + q * k6))
    L = top / bottom
    dL = ((k1 + q * (2 * k2 + q * 3 * k3)) - L * (k4 + q * (2 * k5 + q * 3 * k6))) / bottom
    tangential, by_uv = _tangential(uv, p1, p2)
    return uv * L[:, None] + tangential, _radial_derivative(uv, L, dL) + by_uv


def opencv_by_parameters(uv: Array, parameters: Parameters) -> Array:
    """Derivative of `opencv` with respect to its parameters, (n, 2, 8), columns as in `PARAMETERS`."""
    k1, k2, _, _, k3, k4, k5, k6 = (parameters.get(name, 0.0) for name in PARAMETERS["opencv"])
    q = (uv**2).sum(axis=1)
    top, bottom = 1 + q * (k1 + q * (k2 + q * k3)), 1 + q * (k4 + q * (k5 + q * k6))
    by_top, by_bottom = uv / bottom[:, None], -uv * (top / bottom**2)[:, None]
    powers = [(q**i)[:, None] for i in (1, 2, 3)]
    by_p1, by_p2 = _tangential(uv, 1.0, 0.0)[0], _tangential(uv, 0.0, 1.0)[0]
    numerator, denominator = [by_top * power for power in powers], [by_bottom * power for power in powers]
    return np.stack([*numerator[:2], by_p1, by_p2, numerator[2], *denominator], axis=2)


def polynomial(uv: Array, parameters: Parameters) -> tuple[Array, Array]:
    """Distort by powers of r^2, tangential terms, an affinity before and a shear after them, u right and v down."""
    *k, p1, p2, a1, a2, b2 = (parameters.get(name, 0.0) for name in PARAMETERS["polynomial"])
    q = (uv**2).sum(axis=1)
    L = 1 + sum(value * q**i for i, value in enumerate(k, 1))
    dL = sum(i * value * q ** (i - 1) for i, value in enumerate(k, 1))
    value, by_uv = _tangential(uv, p1, p2)
    value, by_uv = value + uv * L[:, None], by_uv + _radial_derivative(uv, L, dL)
    value[:, 0] += a1 * uv[:, 0] + a2 * uv[:, 1]
    by_uv[:, 0, 0] += a1
    by_uv[:, 0, 1] += a2
    value[:, 0] += b2 * value[:, 1]
    by_uv[:, 0] += np.reshape(b2, (-1, 1)) * by_uv[:, 1]
    return value, by_uv


def polynomial_by_parameters(uv: Array, parameters: Parameters) -> Array:
    """Derivative of `polynomial` with respect to its parameters, (n, 2, 12), columns as in `PARAMETERS`."""
    q = (uv**2).sum(axis=1)[:, None]
    across = np.array([1.0, 0.0])
    columns = [
        *(uv * q**i for i in range(1, 8)),
        *(_tangential(uv, *unit)[0] for unit in ((1.0, 0.0), (0.0, 1.0))),
        uv[:, :1] * across,
        uv[:, 1:] * across,
        polynomial(uv, parameters)[0][:, 1:] * across,
    ]
    by_parameters = np.stack(columns, axis=2)
    by_parameters[:, 0, :-1] += np.reshape(parameters.get("b2", 0.0), (-1, 1)) * by_parameters[:, 1, :-1]
    return by_parameters


def fisheye(uv: Array, parameters: Parameters) -> tuple[Array, Array]:
    """Distort after Kannala and Brandt."""
    ahead = np.concatenate([uv, -np.ones((len(uv), 1))], axis=1)
    value, by_ray, _ = fisheye_of_rays(ahead, [parameters.get(name, 0.0) for name in PARAMETERS["fisheye"]])
    return value, by_ray[:, :, :2]


def fisheye_of_rays(u: Array, k: Sequence[Any]) -> tuple[Array, Array, Array]:
    """Distort after Kannala and Brandt, rays of any direction but backwards: u (n, 3), the camera looks along -z.

    Returns
    -------
    (n, 2), (n, 2, 3), (n, 2, 4)
        The distorted place, and its derivatives by the ray and by k1 ... k4.
    """
    plane, w = u[:, :2], -u[:, 2]
    theta, rho = _off_axis_angle(plane, w)
    on_axis = np.real(rho) < 1e-6 * np.abs(np.real(w))
    safe = np.where(on_axis, 1.0, rho)
    t = theta**2
    radial = 1 + t * (k[0] + t * (k[1] + t * (k[2] + t * k[3])))
    slope = 1 + t * (3 * k[0] + t * (5 * k[1] + t * (7 * k[2] + t * 9 * k[3])))
    # L = r_d / rho; near the axis theta = rho/w - (rho/w)^3/3
    front = np.where(on_axis, w, 1.0)
    theta_by_rho = np.where(on_axis, (1 - (rho / front) ** 2 / 3) / front, theta / safe)
    L = theta_by_rho * radial
    # dr_d = slope dtheta, dtheta = (w drho - rho dw) / (rho^2 + w^2)
    by_rho, by_w = slope * w / (safe**2 + w**2), -slope / (rho**2 + w**2)
    dL_over_rho = np.where(on_axis, 2 * (k[0] - 1 / 3) / front**3, (by_rho - L) / safe**2)
    by_u = np.zeros((len(u), 2, 3), dtype=np.result_type(u, L))
    by_u[:, :, :2] = L[:, None, None] * np.eye(2) + dL_over_rho[:, None, None] * plane[:, :, None] * plane[:, None, :]
    by_u[:, :, 2] = -by_w[:, None] * plane
    by_k = np.stack([plane * (theta_by_rho * t**i)[:, None] for i in (1, 2, 3, 4)], axis=2)
    return L[:, None] * plane, by_u, by_k


def _off_axis_angle(plane: Array, w: Array) -> tuple[Array, Array]:
    """Angle from the viewing direction and distance from the axis; analytic, so that a complex step goes through."""
    rho = np.sqrt((plane**2).sum(axis=1))
    steep = np.real(rho) < np.real(w)
    front = np.where(steep, w, 1.0)
    side = np.where(steep, 1.0, rho)
    theta = np.where(steep, np.arctan(rho / front), np.pi / 2 - np.arctan(w / side))
    return theta, rho


def bal(uv: Array, parameters: Parameters) -> tuple[Array, Array]:
    """Distort after Bundler."""
    k1, k2 = (parameters.get(name, 0.0) for name in PARAMETERS["bal"])
    q = (uv**2).sum(axis=1)
    L = 1 + q * (k1 + q * k2)
    return uv * L[:, None], _radial_derivative(uv, L, k1 + 2 * q * k2)


def _tangential(uv: Array, p1: Any, p2: Any) -> tuple[Array, Array]:
    """Tangential distortion, and its derivative."""
    u, v = uv.T
    q = u**2 + v**2
    value = np.stack([2 * p1 * u * v + p2 * (q + 2 * u**2), p1 * (q + 2 * v**2) + 2 * p2 * u * v], axis=1)
    both = 2 * p1 * u + 2 * p2 * v
    by_uv = np.stack([2 * p1 * v + 6 * p2 * u, both, both, 6 * p1 * v + 2 * p2 * u], axis=1)
    return value, by_uv.reshape(-1, 2, 2)


def _radial_derivative(uv: Array, L: Array, dL_dq: Array) -> Array:
    """Derivative of uv L(q), q = u^2 + v^2."""
    return np.asarray(L[:, None, None] * np.eye(2) + 2 * dL_dq[:, None, None] * uv[:, :, None] * uv[:, None, :])


MODELS = {"bal": bal, "opencv": opencv, "polynomial": polynomial, "fisheye": fisheye}
"""Each model by its name: (ideal (n, 2), parameters) -> distorted (n, 2), derivative (n, 2, 2)."""
