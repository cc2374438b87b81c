"""DBAT's camera models 1 and 3: corrections on the measured side that are not linear in their parameters.

With (u, v) the measured pixel coordinates, v down, s the pixel height: pixels count as square, and what they are wider
is the aspect `as` of model 3, which model 1 leaves out (DBAT's prob2dbatstruct.m):

    model 1   x = s u - px,              y = py - s v
    model 3   x = (1 + as) s u - px',    y = py - s v
    both      xy_corr = (x, y) + (x, y)(K1 r^2 + K2 r^4 + K3 r^6)
                        + (P1 (r^2 + 2 x^2) + 2 P2 x y,  2 P1 x y + P2 (r^2 + 2 y^2)),     r^2 = x^2 + y^2

and the residual is the central projection with c less xy_corr, in mm, weighted with the standard deviation of the
measurement times the pixel size (model 3: residuals in corrected square pixels). px' is DBAT's unknown; its reports
print px = px'/(1 + as) (`printed_principal_point`).

The bundle has model 3 as `brown` of `aatri.camera.models.calibration`; this is the form of the publication, for tests.

Source: Boerlin & Grussenmeyer 2013, 2016; DBAT 0.9.2, Backward (Photogrammetry) models 1 and 3.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float
from aatri.camera.models.brown import PARAMETERS as BROWN
from aatri.camera.models.brown import brown_basis, brown_derivative

Array = npt.NDArray[Any]

PARAMETERS = {
    "dbat1": ("px", "py", "K1", "K2", "K3", "P1", "P2"),
    "dbat3": ("as", "px", "py", "K1", "K2", "K3", "P1", "P2"),
}
"""Parameters of each model, in order; the principal distance belongs to the projection."""


def dbat1(xy_px: Array, parameters: Array, pixel_mm: npt.ArrayLike) -> tuple[Array, Array]:
    """Corrected coordinates of model 1.

    Parameters
    ----------
    xy_px : (n, 2) float64, px
        u right, v down.
    parameters : (7,) float64
        px, py (mm), K1 (mm^-2), K2, K3, P1 (mm^-1), P2.
    pixel_mm : (2,) float64, mm
        Pixel in x and y; DBAT takes its height for both where it reads an export.

    Returns
    -------
    (n, 2) float64, mm, x right, y up, from the principal point
    (n, 2, 7) float64
        Derivative with respect to the parameters.
    """
    size = np.asarray(pixel_mm)
    xy = np.stack([size[0] * xy_px[:, 0] - parameters[0], parameters[1] - size[1] * xy_px[:, 1]], axis=1)
    by_plane = np.zeros((len(xy_px), 2, 2), dtype=xy.dtype)
    by_plane[:, 0, 0], by_plane[:, 1, 1] = -1.0, 1.0
    return _corrected(xy, by_plane, parameters[2:])


def dbat3(xy_px: Array, parameters: Array, pixel_mm: float) -> tuple[Array, Array]:
    """Corrected coordinates of model 3.

    Parameters
    ----------
    xy_px : (n, 2) float64, px
        u right, v down.
    parameters : (8,) float64
        as (1), px', py (mm), K1 (mm^-2), K2, K3, P1 (mm^-1), P2.
    pixel_mm : float, mm
        Pixel height.

    Returns
    -------
    (n, 2) float64, mm, x right, y up, from the principal point
    (n, 2, 8) float64
        Derivative with respect to the parameters.
    """
    aspect, px, py = parameters[:3]
    u, v = pixel_mm * xy_px[:, 0], pixel_mm * xy_px[:, 1]
    xy = np.stack([(1 + aspect) * u - px, py - v], axis=1)
    by_plane = np.zeros((len(xy_px), 2, 3), dtype=xy.dtype)
    by_plane[:, 0, 0], by_plane[:, 0, 1], by_plane[:, 1, 2] = u, -1.0, 1.0
    return _corrected(xy, by_plane, parameters[3:])


def printed_principal_point(aspect: float, px_mm: float) -> tuple[float, Float]:
    """Principal point x as DBAT's reports print it, px'/(1 + as), and its derivative with respect to (as, px')."""
    g = 1.0 / (1.0 + aspect)
    return px_mm * g, np.array([-px_mm * g * g, g])


def _corrected(xy: Array, xy_by_plane: Array, lens: Array) -> tuple[Array, Array]:
    """Add Brown's correction; chain the derivatives of the coordinates with it, append those of the lens."""
    basis = brown_basis(xy)[:, :, :5]
    values = dict(zip(BROWN, lens))
    by_xy = np.eye(2) + brown_derivative(xy, values)
    return xy + basis @ lens, np.concatenate([by_xy @ xy_by_plane, basis], axis=2)
