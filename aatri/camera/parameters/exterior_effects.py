"""What a parameter set has in common with the exterior orientation.

Over flat terrain the six orientation unknowns of a vertical photograph displace its image points by

    X0: (1, 0)   Y0: (0, 1)   Z0: (x, y)   phi: (c + x^2/c, x y/c)   omega: (x y/c, c + y^2/c)   kappa: (y, -x)

up to sign and scale. A parameter in the span of these six is not determined by image points alone: it needs relief,
observed projection centres, crossed flights at two heights or a weight. Columns are compared over a grid of image
points, scaled to unit length.
"""

import numpy as np

from aatri.arrays import Float
from aatri.camera.parameters.parameter_set import SetScale

RANK_TOLERANCE = 1e-10
"""Singular values below this share of the largest count as zero, for columns of unit length."""

EXTERIOR = ("X0", "Y0", "Z0", "phi", "omega", "kappa")
"""Names of the columns of `exterior_effects`."""


def format_grid(scale: SetScale, n: int = 15) -> Float:
    """Regular grid over the format, (n^2, 2) float64, mm; x varies fastest."""
    x, y = (np.linspace(-h, h, n) for h in scale.half_format_mm)
    return np.stack([np.tile(x, n), np.repeat(y, n)], axis=1)


def exterior_effects(xy_mm: Float, principal_distance_mm: float) -> Float:
    """Displacements by the exterior orientation, vertical photograph of flat terrain.

    Parameters
    ----------
    xy_mm : (n, 2) float64, mm

    Returns
    -------
    (n, 2, 6) float64
        Columns as in `EXTERIOR`, in mm per mm (X0, Y0, Z0 in units of the image, Z0 times c) and per radian.
    """
    x, y = xy_mm.T
    c, one, zero = principal_distance_mm, np.ones_like(x), np.zeros_like(x)
    dx = [one, zero, x / c, c + x**2 / c, x * y / c, y]
    dy = [zero, one, y / c, x * y / c, c + y**2 / c, -x]
    return np.stack([np.stack(dx, axis=1), np.stack(dy, axis=1)], axis=1)


def share_in_span(columns: Float, span: Float) -> Float:
    """Share of each column's squared length that lies in the span of others: 0 free of it, 1 wholly in it.

    Parameters
    ----------
    columns : (n, 2, s) float64
    span : (n, 2, t) float64

    Returns
    -------
    (s,) float64
    """
    a, b = _unit_columns(columns), _unit_columns(span)
    vectors, values, _ = np.linalg.svd(b, full_matrices=False)
    inside = vectors[:, values > RANK_TOLERANCE * values[0]] if values.size else vectors
    return np.asarray(((inside.T @ a) ** 2).sum(axis=0))


def _unit_columns(columns: Float) -> Float:
    a = columns.reshape(-1, columns.shape[2])
    length = np.linalg.norm(a, axis=0)
    return np.asarray(a / np.where(length > 0, length, 1.0))
