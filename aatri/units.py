"""Units at the border. Inside: metres, millimetres on the image, radians, seconds.

Factors turn a value in the named unit into the inner unit: `value * ANGLE_RAD["deg"]`.
"""

import math

ANGLE_RAD = {
    "rad": 1.0,
    "mrad": 1e-3,
    "deg": math.pi / 180.0,
    "gon": math.pi / 200.0,
    "mgon": math.pi / 200e3,
    "arcmin": math.pi / 10800.0,
    "arcsec": math.pi / 648000.0,
}
LENGTH_M = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 1e-3, "km": 1e3}
LENGTH_MM = {"mm": 1.0, "um": 1e-3}
TIME_S = {"s": 1.0, "ms": 1e-3}

EARTH_RADIUS_M = 6_371_000.0
"""Radius of the spherical earth used for the curvature correction."""


LARGEST = 1e100
"""No quantity is as large; squares and products of what is smaller are still numbers."""

SMALLEST = 1e-150
"""A smaller standard deviation is no quantity: its square would be 0, which stands for exact."""

FOOT_M = 0.3048
"""The international foot."""


def length(metres: float) -> str:
    """A distance for a message."""
    value, unit = (metres / 1000, "km") if metres >= 1000 else (metres, "m")
    return f"{value:,.0f} {unit}" if value >= 100 else f"{value:.3g} {unit}"
