"""The deformation of a strip of second degree, written out: a reference for `geometry.strip_bases`."""

from __future__ import annotations

import numpy as np

from aatri.arrays import Float
from aatri.geometry.strip_bases import StripAxes


def correction_design(axes: StripAxes, points_m: Float) -> Float:
    """Derivatives of the correction of ground points by the strip's 15 coefficients of second degree.

    The correction is expressed in the strip's axes and turned to the ground: dX = G (a'p, b'p, c'p), p = (1, U, V, U^2,
    U V), with the coefficients a of dU, b of dV, c of dW, in this order.

    Parameters
    ----------
    points_m : (n, 3) float64, m

    Returns
    -------
    (n, 3, 15) float64
    """
    local = (points_m - axes.origin_m) @ axes.ground_from_axes
    u, v = local[:, 0] / axes.half_range_m[0], local[:, 1] / axes.half_range_m[1]
    rows = np.stack([np.ones_like(u), u, v, u * u, u * v], axis=1)
    design = axes.ground_from_axes[None, :, :, None] * rows[:, None, None, :]
    return np.asarray(design.reshape(len(points_m), 3, 15))
