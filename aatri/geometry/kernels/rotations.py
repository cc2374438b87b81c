"""Rotations, compiled: the exponential map of `aatri.geometry.rotations`, applied to one matrix."""

from typing import Any

import numpy as np
from numba import njit

OPTIONS: dict[str, Any] = {"nogil": True, "cache": True, "error_model": "numpy"}
"""Of the compiled functions: a division by zero gives inf, not an exception. Products are not fused with sums: which are,
would depend on what the compiler makes part of the caller, and that on what a process has compiled before."""


@njit("void(float64, float64, float64, float64[:,::1])", **OPTIONS)
def turn(x, y, z, R):
    """Turn R by the rotation vector d = (x, y, z), rad: R <- exp([d]x) R, with exp = I + s [d]x + t [d]x [d]x."""
    square = x * x + y * y + z * z
    angle = np.sqrt(square)
    s = np.sin(angle) / angle if angle > 0.0 else 1.0
    half = np.sin(0.5 * angle) / (0.5 * angle) if angle > 0.0 else 1.0
    t = 0.5 * half * half
    e00, e01, e02 = 1.0 + t * (x * x - square), t * x * y - s * z, t * x * z + s * y
    e10, e11, e12 = t * x * y + s * z, 1.0 + t * (y * y - square), t * y * z - s * x
    e20, e21, e22 = t * x * z - s * y, t * y * z + s * x, 1.0 + t * (z * z - square)
    for k in range(3):
        a, b, c = R[0, k], R[1, k], R[2, k]
        R[0, k] = e00 * a + e01 * b + e02 * c
        R[1, k] = e10 * a + e11 * b + e12 * c
        R[2, k] = e20 * a + e21 * b + e22 * c
