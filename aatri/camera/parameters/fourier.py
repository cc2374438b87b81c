"""Fourier series as additional parameters.

    dx = sum over (m, n) of  a_mn cos(m X + n Y) + b_mn sin(m X + n Y),    X = pi x / w,  Y = pi y / h

and dy likewise with its own coefficients; w, h are half the width and height of the format, so that X and Y run from
-pi to pi in the image. (m, n) are m = 1..M with n = -N..N, and m = 0 with n = 1..N: no pair is the negative of another,
and the constant, which is X0 and Y0, is left out. Orders (1, 1) have 2 x 4 x 2 = 16 parameters. The terms are
orthogonal over the format; those of the first order are close to the exterior orientation, but not in its span. What
differs between opposite borders, as radial distortion does not and a shear does, is approximated slowly.

Names: `cx1-1` is the cosine of (1, -1) in dx, `sy10` the sine of (1, 0) in dy.

Source: Tang, Fritsch & Cramer 2012, New rigorous and flexible Fourier self-calibration models.
"""

import numpy as np

from aatri.arrays import Float
from aatri.camera.parameters.parameter_set import ParameterSet, SetScale, no_classical_values
from aatri.errors import SpecError

HIGHEST_ORDER = 9
"""Waves shorter than a ninth of the format are beyond what tie points determine."""


def fourier(order_x: int = 1, order_y: int = 1) -> ParameterSet:
    """Fourier set of orders M in x and N in y.

    Raises
    ------
    SpecError
        If an order is out of range.
    """
    for order in (order_x, order_y):
        if not 1 <= order <= HIGHEST_ORDER:
            raise SpecError(f"fourier additional parameters of order {order}", remedy=f"1 to {HIGHEST_ORDER}")
    waves = [(0, n) for n in range(1, order_y + 1)]
    waves += [(m, n) for m in range(1, order_x + 1) for n in range(-order_y, order_y + 1)]
    waves.sort(key=lambda mn: (max(mn[0], abs(mn[1])), -mn[0], mn[1]))
    names = [f"{function}{axis}{m}{n}" for axis in "xy" for m, n in waves for function in "cs"]

    def basis(xy_mm: Float, scale: SetScale) -> Float:
        X, Y = (np.pi * xy_mm / np.array(scale.half_format_mm)).T
        terms = np.stack([f(m * X + n * Y) for m, n in waves for f in (np.cos, np.sin)], axis=1)
        zero = np.zeros_like(terms)
        return np.stack([np.concatenate([terms, zero], axis=1), np.concatenate([zero, terms], axis=1)], axis=1)

    count = len(names)
    return ParameterSet("fourier", tuple(names), ("mm",) * count, basis, no_classical_values(count))
