"""Balanced radial terms: the ten parameters of AICON's programs and of Luhmann's textbook.

aicon, with the sign of that community - an image error, x = projection + error -, so that here the correction is its
negative:

    q  = A1 (r^2 - r0^2) + A2 (r^4 - r0^4) + A3 (r^6 - r0^6)
    ex = x dc/c0 + dx0 + x q + B1 (r^2 + 2 x^2) + 2 B2 x y + C1 x + C2 y
    ey = y dc/c0 + dy0 + y q + B2 (r^2 + 2 y^2) + 2 B1 x y

The radial error vanishes at r0, two thirds of half the diagonal unless it is given, so that it is small all over the
format and hardly correlated with c; the unbalanced terms of `brown_conrady` span the same space. x, y and r are ideal
coordinates, as in programs of that community: those of the projection, which is where the error is added.

Source: Luhmann, Robson, Kyle, Harley, Close Range Photogrammetry, interior orientation; r0 as advised there.
"""

import numpy as np

from aatri.arrays import Float
from aatri.camera.parameters.parameter_set import ParameterSet, SetScale

BALANCE = 2.0 / 3.0
"""r0 over half the diagonal."""

_DEGREE = np.array([0.0, 0, 0, 3, 5, 7, 2, 2, 1, 1])


def aicon(balance_radius_mm: float | None = None) -> ParameterSet:
    """The set.

    Parameters
    ----------
    balance_radius_mm : float, mm, optional
        r0, where the radial error vanishes.
    """

    def basis(xy_mm: Float, scale: SetScale) -> Float:
        x, y = (xy_mm / scale.radius_mm).T
        r2, zero, one = x**2 + y**2, np.zeros_like(x), np.ones_like(x)
        c = scale.radius_mm / scale.principal_distance_mm
        r0 = BALANCE if balance_radius_mm is None else balance_radius_mm / scale.radius_mm
        radial = [r2**i - r0 ** (2 * i) for i in (1, 2, 3)]
        ex = [x * c, one, zero, *(x * q for q in radial), r2 + 2 * x**2, 2 * x * y, x, y]
        ey = [y * c, zero, one, *(y * q for q in radial), 2 * x * y, r2 + 2 * y**2, zero, zero]
        return -np.stack([np.stack(ex, axis=1), np.stack(ey, axis=1)], axis=1)

    return ParameterSet(
        name="aicon",
        parameters=("c", "x0", "y0", "A1", "A2", "A3", "B1", "B2", "C1", "C2"),
        units=("mm", "mm", "mm", "mm^-2", "mm^-4", "mm^-6", "mm^-1", "mm^-1", "1", "1"),
        basis=basis,
        classical_factors=lambda scale: np.asarray(scale.radius_mm**-_DEGREE),
        ideal=True,
    )
