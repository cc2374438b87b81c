"""Errors of relative orientations as unknowns of unit variance, and how the points of a model move with them."""

import numpy as np

from aatri.arrays import Float
from aatri.geometry.vectors import tangents, unit


def root_of(orientation_covariance: Float) -> Float:
    """Matrices (..., 5, 5) that turn unit-variance unknowns into errors of an orientation."""
    values, vectors = np.linalg.eigh(orientation_covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :])


def point_errors(xyz: Float, base: Float, root: Float) -> Float:
    """Derivatives of model points by the latent errors of the orientation, of unit variance.

    The rays are held: with the increments d and t of the orientation a point moves along its left ray so far that it
    meets the plane of the base and the right ray; across its rays nothing moves but a y-parallax.

    Parameters
    ----------
    xyz : (n, 3) float64, bases
    base : (n, 3) float64
    root : (n, 5, 5) float64
        Root of the covariance of each point's orientation, `root_of`.

    Returns
    -------
    (n, 3, 5) float64, bases
    """
    w, T = xyz - base, tangents(base)
    across = np.cross(np.cross(xyz, w), w)
    u = unit(xyz)
    of_ray = np.concatenate([np.cross(w, across), np.einsum("ni,nik->nk", across, T)], axis=1)
    along = of_ray / np.einsum("ni,ni->n", across, u)[:, None]
    return np.asarray(u[:, :, None] * along[:, None, :] @ root)
