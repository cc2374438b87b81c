"""Derivatives by complex step: exact to rounding for analytic functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float


def complex_step(f: Callable[[npt.NDArray[Any]], npt.NDArray[Any]], x: Float) -> npt.NDArray[Any]:
    """Jacobian of f at x, shape (size of f, size of x)."""
    columns = []
    for k in range(x.size):
        z = x.astype(complex).ravel()
        z[k] += 1e-200j
        columns.append(np.asarray(f(z.reshape(x.shape))).ravel().imag / 1e-200)
    return np.stack(columns, axis=1)
