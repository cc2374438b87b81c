"""Lens distortion after Brown: a correction added to the measured coordinate.

    dx = x (k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 x^2) + 2 p2 x y + b1 x + b2 y
    dy = y (k1 r^2 + k2 r^4 + k3 r^6) + p2 (r^2 + 2 y^2) + 2 p1 x y

x, y from the principal point, r from the symmetry point (the same unless it is given); mm. Parameters in mm^-2, mm^-4,
mm^-6 (k), mm^-1 (p), 1 (b). The correction is a function of the measured coordinates, linear in its parameters.
Programs that *apply* a distortion to the ideal coordinate have other signs and values: those are the forward models.

Source: Brown 1966, 1971; photogrammetric sign.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

PARAMETERS = ("k1", "k2", "k3", "p1", "p2", "b1", "b2")
"""Names of the parameters, in the order of the derivatives."""


def brown_correction(
    xy_mm: npt.NDArray[Any], parameters: Mapping[str, float], symmetry_point_mm: npt.ArrayLike = (0.0, 0.0)
) -> npt.NDArray[Any]:
    """Correction to add to the measured photo coordinates.

    Parameters
    ----------
    xy_mm : (n, 2) float64, mm, from the principal point
    parameters : mapping
        Values by the names in `PARAMETERS`; what is missing is zero.
    symmetry_point_mm : (2,) float64, mm, from the principal point

    Returns
    -------
    (n, 2) float64, mm

    Examples
    --------
    At a radius of 100 mm a coefficient k1 of 1e-8 per mm^2 corrects by k1 r^3, 10 um:

    >>> brown_correction(np.array([[100.0, 0.0]]), {"k1": 1e-8}).round(9)
    array([[0.01, 0.  ]])
    """
    k1, k2, k3, p1, p2, b1, b2 = (parameters.get(name, 0.0) for name in PARAMETERS)
    x, y = xy_mm.T
    r2 = ((xy_mm - np.asarray(symmetry_point_mm)) ** 2) @ np.ones(2)
    radial, xy = r2 * (k1 + r2 * (k2 + r2 * k3)), x * y
    dx = x * radial + p1 * (r2 + 2 * x**2) + 2 * p2 * xy + b1 * x + b2 * y
    dy = y * radial + 2 * p1 * xy + p2 * (r2 + 2 * y**2)
    return np.column_stack([dx, dy])


def brown_basis(xy_mm: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Derivative of the correction with respect to its parameters.

    Returns
    -------
    (n, 2, 7) float64
        Columns as in `PARAMETERS`.
    """
    x, y = xy_mm.T
    r2 = (xy_mm**2).sum(axis=1)
    zero = np.zeros_like(x)
    dx = [x * r2, x * r2**2, x * r2**3, r2 + 2 * x**2, 2 * x * y, x, y]
    dy = [y * r2, y * r2**2, y * r2**3, 2 * x * y, r2 + 2 * y**2, zero, zero]
    return np.stack([np.stack(dx, axis=1), np.stack(dy, axis=1)], axis=1)


def brown_derivative(
    xy_mm: npt.NDArray[Any], parameters: Mapping[str, Any], symmetry_point_mm: npt.ArrayLike = (0.0, 0.0)
) -> npt.NDArray[Any]:
    """Derivative of the correction by the measured coordinates, (n, 2, 2); parameters may be given point by point."""
    k1, k2, k3, p1, p2, b1, b2 = (parameters.get(name, 0.0) for name in PARAMETERS)
    x, y = xy_mm.T
    rx, ry = (xy_mm - np.asarray(symmetry_point_mm)).T
    r2 = rx**2 + ry**2
    radial = k1 * r2 + k2 * r2**2 + k3 * r2**3
    slope = 2 * (k1 + 2 * k2 * r2 + 3 * k3 * r2**2)
    columns = [
        radial + slope * x * rx + p1 * (2 * rx + 4 * x) + 2 * p2 * y + b1,
        slope * x * ry + 2 * p1 * ry + 2 * p2 * x + b2,
        slope * y * rx + 2 * p2 * rx + 2 * p1 * y,
        radial + slope * y * ry + p2 * (2 * ry + 4 * y) + 2 * p1 * x,
    ]
    return np.stack(columns, axis=1).reshape(-1, 2, 2)
