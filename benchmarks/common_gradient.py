"""Cost and gradient of a solution, whatever program found it: the one measure both are held to.

The cost is half the sum of squares of the whitened residuals: image coordinates in units of their standard deviation,
observed positions likewise. The gradient is taken in the parameters COLMAP hands to Ceres, as Ceres's own test of
convergence takes it: per image half the rotation vector theta of R <- exp([2 theta]x) R, R = camera from ground, and
t = -R X0; per point X. From the gradients in X0 and in d of `R' <- exp([d]x) R'` (ground side):

    g_t = -R g_X0,    g_theta = -2 R (g_d + X0 x g_X0),    norm = largest |component|

X0 counts from the mean of the projection centres, to which COLMAP reduces as well.
"""

from __future__ import annotations

import numpy as np

from aatri.arrays import Float, Int
from aatri.geometry.collinearity import collinearity
from benchmarks.blocks import ArrayBlock


def cost_and_gradient(block: ArrayBlock, X0: Float, ground_from_image: Float, X: Float) -> tuple[float, float]:
    """Cost and gradient norm.

    Parameters
    ----------
    block : ArrayBlock
    X0 : (n, 3) float64, m
    ground_from_image : (n, 3, 3) float64
    X : (p, 3) float64, m

    Returns
    -------
    cost, norm : float
    """
    i, p, n = block.image, block.point, len(X0)
    c = np.full(len(i), block.c_mm)
    cost, by_pose, by_point = 0.0, np.zeros((n, 6)), np.zeros((len(X), 3))
    for first in range(0, len(i), 200_000):
        k = slice(first, first + 200_000)
        xy, J, B = collinearity(X0[i[k]], ground_from_image[i[k]], X[p[k]], c[k])
        v = (xy - block.xy_mm[k]) / block.sigma_mm
        cost += 0.5 * float((v**2).sum())
        by_pose += _summed(i[k], np.einsum("nij,ni->nj", J, v) / block.sigma_mm, n)
        by_point += _summed(p[k], np.einsum("nij,ni->nj", B, v) / block.sigma_mm, len(X))
    v = (X0 - block.gnss_m) / block.gnss_sigma_m
    cost += 0.5 * float((v**2).sum())
    by_pose[:, :3] += v / block.gnss_sigma_m
    R = np.diag([1.0, -1.0, -1.0]) @ ground_from_image.swapaxes(1, 2)
    moment = by_pose[:, 3:] + np.cross(X0 - X0.mean(axis=0), by_pose[:, :3])
    g_t, g_theta = R @ by_pose[:, :3, None], 2 * R @ moment[:, :, None]
    return cost, float(max(np.abs(g).max() for g in (g_t, g_theta, by_point)))


def _summed(row: Int, values: Float, n: int) -> Float:
    return np.stack([np.bincount(row, values[:, j], minlength=n) for j in range(values.shape[1])], axis=1)
