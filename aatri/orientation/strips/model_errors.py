"""How the points of a model move with the errors of its relative orientation."""

from __future__ import annotations

import numpy as np

from aatri.arrays import Float
from aatri.geometry.vectors import tangents, unit


def point_errors(xyz: Float, base: Float, root: Float) -> Float:
    """Derivatives of model points by the latent errors of the orientation, of unit variance.

    The rays are held: with the increments d and t of the orientation a point moves along its left ray so far that it
    meets the plane of the base and the right ray; across its rays nothing moves but a y-parallax.

    Parameters
    ----------
    xyz : (n, 3) float64, bases
    base : (n, 3) float64
    root : (n, 5, 5) float64
        Root of the covariance of each point's orientation, `log_scale.root_of`.

    Returns
    -------
    (n, 3, 5) float64, bases
    """
    w, T = xyz - base, np.array([tangents(b) for b in base]).reshape(-1, 3, 2)
    across = np.cross(np.cross(xyz, w), w)
    u = unit(xyz)
    of_ray = np.concatenate([np.cross(w, across), np.einsum("ni,nik->nk", across, T)], axis=1)
    along = of_ray / np.einsum("ni,ni->n", across, u)[:, None]
    return np.asarray(u[:, :, None] * along[:, None, :] @ root)
