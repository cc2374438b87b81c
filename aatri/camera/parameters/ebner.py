"""Ebner's 12 and Bauer's 3 parameters.

ebner12, b the photo base, orthogonal to each other and to the six effects of the exterior orientation of vertical
photographs of flat terrain on the nine Gruber positions x, y in {0, +-b}; with u(t) = t^2 - 2 b^2/3:

    dx =  b1 x + b2 y - 2 b3 u(x) + b4 x y + b5 u(y)            + b7 x u(y) + b9 y u(x)  + b11 u(x) u(y)
    dy = -b1 y + b2 x + b3 x y - 2 b4 u(y)            + b6 u(x) + b8 y u(x) + b10 x u(y) + b12 u(x) u(y)

18 = 2 x 9 displacements less 6 of the orientation leave 12.

bauer3: one radial term that vanishes at the radius r0, one shear, one affine:

    dx = a1 x (r^2 - r0^2) - a3 x,    dy = a1 y (r^2 - r0^2) + a2 x + a3 y

r0 is 100 mm for 23 cm film in the notes; without a value it is taken so that a1 is orthogonal to Z0 over the format.
The form with -a3 y in dx, often printed, is a misprint: it repeats half of a rotation and half of a scale.

Source: Ebner 1976, Bildmessung und Luftbildwesen 44; Bauer & Mueller 1972.
"""

import numpy as np

from aatri.arrays import Float
from aatri.camera.parameters.parameter_set import ParameterSet, SetScale


def _ebner_basis(xy_mm: Float, scale: SetScale) -> Float:
    x, y = (xy_mm / scale.base_mm).T
    u, v = x**2 - 2 / 3, y**2 - 2 / 3
    zero = np.zeros_like(x)
    dx = [x, y, -2 * u, x * y, v, zero, x * v, zero, y * u, zero, u * v, zero]
    dy = [-y, x, x * y, -2 * v, zero, u, zero, y * u, zero, x * v, zero, u * v]
    return np.stack([np.stack(dx, axis=1), np.stack(dy, axis=1)], axis=1)


_EBNER_DEGREE = np.array([1.0, 1, 2, 2, 2, 2, 3, 3, 3, 3, 4, 4])

EBNER12 = ParameterSet(
    name="ebner12",
    parameters=tuple(f"b{i}" for i in range(1, 13)),
    units=("1", "1", *["mm^-1"] * 4, *["mm^-2"] * 4, "mm^-3", "mm^-3"),
    basis=_ebner_basis,
    classical_factors=lambda scale: np.asarray(scale.base_mm**-_EBNER_DEGREE),
)


def bauer3(balance_radius_mm: float | None = None) -> ParameterSet:
    """Bauer's set.

    Parameters
    ----------
    balance_radius_mm : float, mm, optional
        r0, where the radial term vanishes.
    """

    def basis(xy_mm: Float, scale: SetScale) -> Float:
        x, y = (xy_mm / scale.radius_mm).T
        r0 = balancing_radius_mm(scale) if balance_radius_mm is None else balance_radius_mm
        radial = x**2 + y**2 - (r0 / scale.radius_mm) ** 2
        zero = np.zeros_like(x)
        dx, dy = [x * radial, zero, -x], [y * radial, x, y]
        return np.stack([np.stack(dx, axis=1), np.stack(dy, axis=1)], axis=1)

    return ParameterSet(
        name="bauer3",
        parameters=("a1", "a2", "a3"),
        units=("mm^-2", "1", "1"),
        basis=basis,
        classical_factors=lambda scale: np.asarray(scale.radius_mm ** -np.array([3.0, 1.0, 1.0])),
    )


def balancing_radius_mm(scale: SetScale) -> float:
    """Radius r0 for which (x, y)(r^2 - r0^2) is orthogonal to (x, y) over the format: r0^2 = E r^4 / E r^2."""
    a, b = (h**2 for h in scale.half_format_mm)
    return float(np.sqrt((a**2 / 5 + b**2 / 5 + 2 * a * b / 9) / ((a + b) / 3)))
