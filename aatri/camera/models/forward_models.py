"""Distortion models of other communities: ideal to distorted, in normalised coordinates (principal distance 1).

opencv, with u right and v DOWN as there:

    L   = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)
    u_d = u L + 2 p1 u v + p2 (r^2 + 2 u^2),   v_d = v L + p1 (r^2 + 2 v^2) + 2 p2 u v

fisheye (Kannala-Brandt): theta = atan r, r_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8)
bal (Bundler): r_d = r (1 + k1 r^2 + k2 r^4)

Each function returns f (n, 2) and its derivative (n, 2, 2); a parameter is one number, or one per point. The last two
are radial, so that the direction of v does not matter.

Source: OpenCV documentation, calib3d; Kannala & Brandt 2006; Agarwal et al. 2010.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]
Parameters = Mapping[str, Any]
"""Values by name: a number or an array (n,)."""

PARAMETERS = {
    "opencv": ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    "fisheye": ("k1", "k2", "k3", "k4"),
    "bal": ("k1", "k2"),
}
"""Names of the parameters of each model."""


def opencv(uv: Array, parameters: Parameters) -> tuple[Array, Array]:
    """Distort after OpenCV, u right and v down."""
    k1, k2, p1, p2, k3, k4, k5, k6 = (parameters.get(name, 0.0) for name in PARAMETERS["opencv"])
    u, v = uv[:, 0], uv[:, 1]
    q = u**2 + v**2
    top, bottom = 1 + q * (k1 + q * (k2 + q * k3)), 1 + q * (k4 + q * (k5 + q * k6))
    L = top / bottom
    dL = ((k1 + q * (2 * k2 + q * 3 * k3)) - L * (k4 + q * (2 * k5 + q * 3 * k6))) / bottom
    value = np.stack(
        [u * L + 2 * p1 * u * v + p2 * (q + 2 * u**2), v * L + p1 * (q + 2 * v**2) + 2 * p2 * u * v], axis=1
    )
    tangential = np.stack(
        [2 * p1 * v + 6 * p2 * u, 2 * p1 * u + 2 * p2 * v, 2 * p1 * u + 2 * p2 * v, 6 * p1 * v + 2 * p2 * u], axis=1
    ).reshape(-1, 2, 2)
    return value, _radial_derivative(uv, L, dL) + tangential


def opencv_by_parameters(uv: Array, parameters: Parameters) -> Array:
    """Derivative of `opencv` with respect to its parameters, (n, 2, 8), columns as in `PARAMETERS`."""
    k1, k2, _, _, k3, k4, k5, k6 = (parameters.get(name, 0.0) for name in PARAMETERS["opencv"])
    u, v = uv[:, 0], uv[:, 1]
    q = u**2 + v**2
    top, bottom = 1 + q * (k1 + q * (k2 + q * k3)), 1 + q * (k4 + q * (k5 + q * k6))
    by_top, by_bottom = uv / bottom[:, None], -uv * (top / bottom**2)[:, None]
    powers = [(q**i)[:, None] for i in (1, 2, 3)]
    by_p1 = np.stack([2 * u * v, q + 2 * v**2], axis=1)
    by_p2 = np.stack([q + 2 * u**2, 2 * u * v], axis=1)
    numerator, denominator = [by_top * power for power in powers], [by_bottom * power for power in powers]
    return np.stack([*numerator[:2], by_p1, by_p2, numerator[2], *denominator], axis=2)


def fisheye(uv: Array, parameters: Parameters) -> tuple[Array, Array]:
    """Distort after Kannala and Brandt."""
    k1, k2, k3, k4 = (parameters.get(name, 0.0) for name in PARAMETERS["fisheye"])
    q = (uv**2).sum(axis=1)
    near_axis = np.real(q) < 1e-12
    r = np.sqrt(np.where(near_axis, 1.0, q))
    theta = np.arctan(r)
    t = theta**2
    r_d = theta * (1 + t * (k1 + t * (k2 + t * (k3 + t * k4))))
    slope = (1 + t * (3 * k1 + t * (5 * k2 + t * (7 * k3 + t * 9 * k4)))) / (1 + r**2)
    # near the axis r_d = r + (k1 - 1/3) r^3: the quotient r_d / r in powers of q
    L = np.where(near_axis, 1 + (k1 - 1 / 3) * q, r_d / r)
    dL = np.where(near_axis, k1 - 1 / 3, (slope - r_d / r) / (2 * r**2))
    return uv * L[:, None], _radial_derivative(uv, L, dL)


def bal(uv: Array, parameters: Parameters) -> tuple[Array, Array]:
    """Distort after Bundler."""
    k1, k2 = (parameters.get(name, 0.0) for name in PARAMETERS["bal"])
    q = (uv**2).sum(axis=1)
    L = 1 + q * (k1 + q * k2)
    return uv * L[:, None], _radial_derivative(uv, L, k1 + 2 * q * k2)


def _radial_derivative(uv: Array, L: Array, dL_dq: Array) -> Array:
    """Derivative of uv L(q), q = u^2 + v^2."""
    return np.asarray(L[:, None, None] * np.eye(2) + 2 * dL_dq[:, None, None] * uv[:, :, None] * uv[:, None, :])


MODELS = {"bal": bal, "opencv": opencv, "fisheye": fisheye}
"""Each model by its name: (ideal (n, 2), parameters) -> distorted (n, 2), derivative (n, 2, 2)."""
