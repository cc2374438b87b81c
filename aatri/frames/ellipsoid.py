"""Closed forms of the ellipsoid: geocentric coordinates, the normal of a place and the height along it.

    G = ((N + h) cos(phi) cos(lambda), (N + h) cos(phi) sin(lambda), (N (1 - e2) + h) sin(phi)),
    N = a / sqrt(1 - e2 sin2(phi)),    h = p cos(phi) + z sin(phi) - a sqrt(1 - e2 sin2(phi))

The latitude of a geocentric place is found by Bowring's formula, repeated with the parametric latitude: to 1e-15 rad
from 10 km below to 10 000 km above the ellipsoid. All works on complex numbers too, for derivatives by complex step.

Source: Bowring 1976, Survey Review 23; Torge, Geodesy.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

REPEATS = 4


@dataclass(frozen=True)
class Ellipsoid:
    """Semi-major axis a, m, and square of the first eccentricity."""

    a_m: float
    e2: float


def geocentric(degrees: npt.NDArray[Any], ellipsoid: Ellipsoid) -> npt.NDArray[Any]:
    """Geocentric coordinates of longitude, latitude (degrees) and ellipsoidal height (m).

    Parameters
    ----------
    degrees : (n, 3) float64, degrees, degrees, m

    Returns
    -------
    (n, 3) float64, m
    """
    longitude, latitude, h = np.radians(degrees[:, 0]), np.radians(degrees[:, 1]), degrees[:, 2]
    sine, cosine = np.sin(latitude), np.cos(latitude)
    N = ellipsoid.a_m / np.sqrt(1 - ellipsoid.e2 * sine**2)
    p = (N + h) * cosine
    return np.stack([p * np.cos(longitude), p * np.sin(longitude), (N * (1 - ellipsoid.e2) + h) * sine], axis=1)


def normal_and_height(geocentric_m: npt.NDArray[Any], ellipsoid: Ellipsoid) -> tuple[Any, Any]:
    """Unit normal of the ellipsoid below places, and their height along it.

    Parameters
    ----------
    geocentric_m : (n, 3) float64 or complex, m

    Returns
    -------
    normal : (n, 3)
    height_m : (n,)
    """
    x, y, z = geocentric_m.T
    a, e2 = ellipsoid.a_m, ellipsoid.e2
    b = a * np.sqrt(1 - e2)
    p = np.sqrt(x * x + y * y)
    s, c = _unit(z * a, p * b)
    for _ in range(REPEATS):
        sine, cosine = _unit(z + e2 / (1 - e2) * b * s**3, p - e2 * a * c**3)
        s, c = _unit(b * sine, a * cosine)
    off_axis = p.real > 0
    along = np.where(off_axis, cosine / np.where(off_axis, p, 1.0), 0.0)
    h = p * cosine + z * sine - a * np.sqrt(1 - e2 * sine**2)
    return np.stack([along * x, along * y, sine], axis=1), h


def geographic(geocentric_m: npt.NDArray[Any], ellipsoid: Ellipsoid) -> npt.NDArray[Any]:
    """Longitude, latitude (degrees) and ellipsoidal height (m) of real geocentric coordinates; (n, 3)."""
    normal, h = normal_and_height(geocentric_m, ellipsoid)
    longitude = np.degrees(np.arctan2(geocentric_m[:, 1], geocentric_m[:, 0]))
    latitude = np.degrees(np.arctan2(normal[:, 2], np.hypot(normal[:, 0], normal[:, 1])))
    return np.stack([longitude, latitude, h], axis=1)


def local_axes(longitude_deg: float, latitude_deg: float) -> npt.NDArray[Any]:
    """East, north and up of a place as the columns of a matrix, in geocentric axes."""
    longitude, latitude = np.radians(longitude_deg), np.radians(latitude_deg)
    sl, cl, sp, cp = np.sin(longitude), np.cos(longitude), np.sin(latitude), np.cos(latitude)
    return np.array([[-sl, -sp * cl, cp * cl], [cl, -sp * sl, cp * sl], [0.0, cp, sp]])


def _unit(sine: Any, cosine: Any) -> tuple[Any, Any]:
    length = np.sqrt(sine * sine + cosine * cosine)
    return sine / length, cosine / length
