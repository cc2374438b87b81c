"""Transformations of the plane onto the photo system: similarity, affine, bilinear, projective.

    similarity   x = a u - b v + c,  y = b u + a v + d                       (u, v nominal: same handedness, same unit)
    affine       x = a0 u + a1 v + a2,  y = b0 u + b1 v + b2
    bilinear     affine + (e, f) u v
    projective   x = (a0 u + a1 v + a2) / (1 + e u + f v),  y = (b0 u + b1 v + b2) / (1 + e u + f v)

All are told by a matrix [[a0, a1, a2], [b0, b1, b2]] and two `terms` (e, f), zero for the first two.

What n marks leave open is a small correction K d in the photo system, K one of

    similarity   dx = d0 + d1 x - d2 y                          dy = d3 + d2 x + d1 y
    affine       dx = d0 + d1 x + d2 y                          dy = d3 + d4 x + d5 y
    bilinear     ... + d6 q                                     ... + d7 q,  q the product along the measured axes, mm^2
    projective   ... + d6 x^2 + d7 x y                          ... + d6 x y + d7 y^2

Source: Kraus, Photogrammetry 1, sec. 3.2; docs/formulas.md 2.2.
"""

import numpy as np

from aatri.arrays import Float

PARAMETERS: dict[str, int] = {"similarity": 4, "affine": 6, "bilinear": 8, "projective": 8}
"""Number of parameters of each transformation."""

MOST_PARAMETERS = 8


def transform_plane(model: str, matrix: Float, terms: Float, uv: Float) -> Float:
    """Transformed points.

    Parameters
    ----------
    model : str
        One of `PARAMETERS`.
    matrix : (..., 2, 3) float64, mm per unit and mm
    terms : (..., 2) float64
        Of the product u v, mm per unit squared (bilinear); of the denominator, 1 per unit (projective).
    uv : (..., m, 2) float64, in units of the measurement

    Returns
    -------
    (..., m, 2) float64, mm
    """
    xy = uv @ matrix[..., :2].swapaxes(-1, -2) + matrix[..., None, :, 2]
    if model == "bilinear":
        xy = xy + (uv[..., 0] * uv[..., 1])[..., None] * terms[..., None, :]
    elif model == "projective":
        xy = xy / (1.0 + np.einsum("...mi,...i->...m", uv, terms))[..., None]
    return np.asarray(xy)


def plane_jacobian(model: str, matrix: Float, terms: Float, uv: Float) -> Float:
    """Derivatives of the transformed points to the measured ones, (..., m, 2, 2), mm per unit."""
    J = np.broadcast_to(matrix[..., None, :, :2], (*uv.shape, 2))
    if model == "bilinear":
        return np.asarray(J + terms[..., None, :, None] * uv[..., None, ::-1])
    if model == "projective":
        w = 1.0 + np.einsum("...mi,...i->...m", uv, terms)
        xy = transform_plane(model, matrix, terms, uv)
        return np.asarray((J - xy[..., None] * terms[..., None, None, :]) / w[..., None, None])
    return np.asarray(J)


def basis_of(model: str, x: Float, y: Float, q: Float) -> Float:
    """K of the module's text, (..., 2, 8); columns beyond the parameters of the model are zero."""
    K = np.zeros((*x.shape, 2, MOST_PARAMETERS))
    K[..., 0, 0] = K[..., 1, 3] = 1.0
    K[..., 0, 1] = x
    if model == "similarity":
        K[..., 0, 2], K[..., 1, 1], K[..., 1, 2] = -y, y, x
        return K
    K[..., 0, 2], K[..., 1, 4], K[..., 1, 5] = y, x, y
    if model == "bilinear":
        K[..., 0, 6] = K[..., 1, 7] = q
    elif model == "projective":
        K[..., 0, 6], K[..., 0, 7], K[..., 1, 6], K[..., 1, 7] = x * x, x * y, x * y, y * y
    return K


def open_basis(model: str, photo_mm: Float, photo_from_nominal: Float) -> Float:
    """Corrections K d that a fit leaves open, at photo coordinates.

    Parameters
    ----------
    photo_mm : (..., 2) float64, mm, from the fiducial centre
    photo_from_nominal : (..., 2, 2) float64
        Linear part: the axes of the measurement, along which the product of the bilinear form is.

    Returns
    -------
    (..., 2, 8) float64
    """
    q = np.zeros(photo_mm.shape[:-1])
    if model == "bilinear":
        along = np.linalg.solve(photo_from_nominal, photo_mm[..., None])[..., 0]
        q = along[..., 0] * along[..., 1]
    return basis_of(model, photo_mm[..., 0], photo_mm[..., 1], q)
