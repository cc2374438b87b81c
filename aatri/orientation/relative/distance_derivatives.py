"""Distance of model points from the left projection centre, with its exact derivatives by the orientation.

    r = |X|,   X = (l1 u1 + b + l2 w) / 2,   w = R u2

u1, u2 after the correction that makes them coplanar with the base (`geometry.coplanarity.corrected`), which depends on
the orientation too: F and its gradient g turn with E, and with them -F S g / (g' S g). Everything is differentiated
along d (R <- exp([d]x) R) and t (b <- b + T t), step by step as it is computed.

Source: docs/formulas.md 3.1, 3.4; geometry/intersection.py.
"""

import numpy as np

from aatri.arrays import Float
from aatri.geometry.coplanarity import RayPairs, essential_derivatives, essential_matrix
from aatri.geometry.vectors import tangents

CORRECTIONS = 2
"""As in `geometry.coplanarity.corrected`."""


def log_distances(R: Float, base: Float, rays: RayPairs) -> tuple[Float, Float]:
    """Logarithms of the distances, and their derivatives.

    Parameters
    ----------
    R, base : (3, 3), (3,) float64
        Left from right, and the unit base.
    rays : RayPairs
        As measured.

    Returns
    -------
    log_r : (n,) float64
    J : (n, 5) float64
        By d and t.
    """
    T = tangents(base)
    (u1, du1), (u2, du2) = _coplanar(R, base, T, rays)
    w = u2 @ R.T
    dw = np.einsum("ij,njk->nik", R, du2)
    dw[:, :, :3] += np.cross(np.eye(3)[None], w[:, None, :]).swapaxes(1, 2)
    db = np.zeros((3, 5))
    db[:, 3:] = T
    cross, dcross = np.cross(u1, w), _cross(du1, w) - _cross(dw, u1)
    square, dsquare = _dot(cross, cross), 2.0 * _dot_each(cross, dcross)
    ends = []
    for ray, dray in ((w, dw), (u1, du1)):
        along = np.cross(base, ray)
        d_along = _cross(np.broadcast_to(db, (len(w), 3, 5)), ray) - _cross(dray, np.broadcast_to(base, w.shape))
        length = _dot(along, cross) / square
        d_length = _dot_each(along, dcross) + _dot_each(cross, d_along) - length[:, None] * dsquare
        ends.append((length, d_length / square[:, None]))
    (l1, dl1), (l2, dl2) = ends
    X = 0.5 * (l1[:, None] * u1 + base + l2[:, None] * w)
    dX = l1[:, None, None] * du1 + u1[:, :, None] * dl1[:, None] + l2[:, None, None] * dw + w[:, :, None] * dl2[:, None]
    dX = 0.5 * (dX + db)
    r2 = _dot(X, X)
    return np.asarray(0.5 * np.log(r2)), np.asarray(_dot_each(X, dX) / r2[:, None])


def _coplanar(R: Float, base: Float, T: Float, rays: RayPairs) -> tuple[tuple[Float, Float], tuple[Float, Float]]:
    """Corrected rays of both images and their derivatives (n, 3, 5)."""
    E, dE = essential_matrix(R, base), essential_derivatives(R, base, T)
    variance = np.concatenate([rays.left_sigma, rays.right_sigma], axis=1) ** 2
    u1, u2 = rays.left.copy(), rays.right.copy()
    du1, du2 = np.zeros((len(u1), 3, 5)), np.zeros((len(u1), 3, 5))
    for _ in range(CORRECTIONS):
        of_left, of_right = u2 @ E.T, u1 @ E
        d_left = np.einsum("kij,nj->nik", dE, u2) + np.einsum("ij,njk->nik", E, du2)
        d_right = np.einsum("kji,nj->nik", dE, u1) + np.einsum("ji,njk->nik", E, du1)
        F, dF = _dot(u1, of_left), _dot_each(u1, d_left) + _dot_each(of_left, du1)
        g = np.concatenate([of_left[:, :2], of_right[:, :2]], axis=1)
        dg = np.concatenate([d_left[:, :2], d_right[:, :2]], axis=1)
        weighted = variance * g
        q = _dot(g, weighted)
        share = F / q
        d_share = (dF - share[:, None] * 2.0 * _dot_each(weighted, dg)) / q[:, None]
        change = -share[:, None] * weighted
        d_change = -(weighted[:, :, None] * d_share[:, None] + share[:, None, None] * variance[:, :, None] * dg)
        u1[:, :2] += change[:, :2]
        u2[:, :2] += change[:, 2:]
        du1[:, :2] += d_change[:, :2]
        du2[:, :2] += d_change[:, 2:]
    return (u1, du1), (u2, du2)


def _dot(a: Float, b: Float) -> Float:
    return np.asarray(np.einsum("ni,ni->n", a, b))


def _dot_each(a: Float, d: Float) -> Float:
    """a . each column of d, (n, k)."""
    return np.asarray(np.einsum("ni,nik->nk", a, d))


def _cross(d: Float, b: Float) -> Float:
    """Each column of d x b, (n, 3, k)."""
    return np.asarray(np.cross(d.swapaxes(1, 2), b[:, None, :]).swapaxes(1, 2))
