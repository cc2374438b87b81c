"""Model coordinates by the rules of the lecture notes: two point projection coefficients and a mean.

    N1 = (Bx Z2 - Bz X2) / (X1 Z2 - X2 Z1),   N2 = (Bx Z1 - Bz X1) / (X1 Z2 - X2 Z1)
    X = N1 X1,   Y = (N1 Y1 + By + N2 Y2) / 2,   Z = N1 Z1

(X1, Y1, Z1) the left ray, (X2, Y2, Z2) the right one, turned, in the frame of the left image with its X axis nearest to
the base (turned by a multiple of 90 degrees about its Z axis, where the camera is mounted across). The rays are those
measured: what remains of the y-parallax is halved, X and Z rest on x alone. The rigorous intersection
(geometry.intersection) shares the correction among all four coordinates.

A connection point, which the model before has too, keeps the height Z that it has there, counted from the common
projection centre and in the unit of this model; the right image gives the rest (By and Bz are those of the base B):

    N2 = (Z - Bz) / Z2,    X = Bx + N2 X2,   Y = By + N2 Y2        Z = N2a Z2a of the model before, over the scale

Source: lecture notes A401, A403.
"""

import numpy as np

from aatri.arrays import Float
from aatri.geometry.coplanarity import RayPairs


def classical_points(left_from_right: Float, base: Float, rays: RayPairs) -> Float:
    """Points of a model.

    Parameters
    ----------
    left_from_right : (3, 3) float64
    base : (3,) float64

    Returns
    -------
    (n, 3) float64, unit of the base, frame of the left image
    """
    quarter = np.round(np.arctan2(base[1], base[0]) / (0.5 * np.pi)) * 0.5 * np.pi
    c, s = np.cos(quarter), np.sin(quarter)
    along = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])  # from the left image to the frame along the base
    X1, Y1, Z1 = (rays.left @ along.T).T
    X2, Y2, Z2 = (rays.right @ left_from_right.T @ along.T).T
    Bx, By, Bz = along @ base
    D = X1 * Z2 - X2 * Z1
    N1, N2 = (Bx * Z2 - Bz * X2) / D, (Bx * Z1 - Bz * X1) / D
    return np.asarray(np.column_stack([N1 * X1, 0.5 * (N1 * Y1 + By + N2 * Y2), N1 * Z1]) @ along)


def connection_points(left_from_right: Float, base: Float, rays: RayPairs, height: Float) -> Float:
    """Points of a model that keep the height of the model before.

    Parameters
    ----------
    left_from_right : (3, 3) float64
    base : (3,) float64
    height : (n,) float64, unit of the base
        Z in the frame of the left image.

    Returns
    -------
    (n, 3) float64, unit of the base, frame of the left image
    """
    ray = rays.right @ left_from_right.T
    return np.asarray(base + ((height - base[2]) / ray[:, 2])[:, None] * ray)
