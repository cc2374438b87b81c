"""Space intersection from images whose orientations are uncertain: every point for itself, by least squares.

    v = x(X) - x_observed,    C_v = sigma^2 I + A Q A'    of a ray: its own errors, and those of its pose
    N = sum J' C_v^-1 J,      dX = -N^-1 sum J' C_v^-1 v,    C_X = N^-1

A = dx/dpose, J = dx/dX, Q the covariance of the pose. Poses of different images are taken as independent; points then
tell nothing of poses, and each has the covariance that its own images give it.

Source: Kraus, Photogrammetry; docs/formulas.md 3.4.
"""

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float, Int, finite_rows
from aatri.geometry.collinearity import collinearity
from aatri.geometry.intersection import intersect_rays
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.poses import Poses

MOST_ITERATIONS = 20
SETTLED = 1e-6
"""Of the standard deviation: a smaller step ends the iteration."""

OPEN = 1e-12
"""Eigenvalues of N below this share of the largest leave a point open."""


@dataclass(frozen=True)
class UncertainIntersection:
    """Intersected points."""

    xyz_m: Float
    """(n, 3), m. NaN where fewer than two images see the point, or its rays are parallel."""
    covariance_m2: Float
    """(n, 3, 3), m^2."""
    rays: Int
    """(n,). Rays used."""
    whitened: Float
    """(m, 2). Residuals of all rays over their standard deviations, whitened by C_v; NaN where not used."""
    residual_mm: Float
    sigma_mm: Float
    """(m, 2), mm. Residuals and their standard deviations from C_v."""
    used: Bool
    """(m,)."""


def intersect_uncertain(rays: ImagePointRows, poses: Poses, covariance: Float, n_points: int) -> UncertainIntersection:
    """Intersect points from poses with covariances.

    Parameters
    ----------
    poses : Poses
        NaN where not oriented.
    covariance : (n_images, 6, 6) float64, m and rad
        Of X0 and the rotation d, R <- exp([d]x) R.
    """
    image, point, X0, R = rays.image, rays.point, poses.position_m, poses.ground_from_image
    oriented = finite_rows(X0) & finite_rows(R) & np.isfinite(covariance).all(axis=(1, 2))
    use = np.flatnonzero(rays.active & oriented[image] & finite_rows(rays.xy_mm))
    use = use[np.bincount(point[use], minlength=n_points)[point[use]] >= 2]
    xyz = intersect_rays(X0[image[use]], rays.directions(poses, use), point[use], n_points)
    use = use[finite_rows(xyz[point[use]])]

    def linearised(rows: Int) -> tuple[Float, Float, Float]:
        """v, J and the weights C_v^-1 of some rays."""
        i = image[rows]
        computed, A, J = collinearity(X0[i], R[i], xyz[point[rows]], rays.c_mm[rows])
        C = A @ covariance[i] @ A.swapaxes(1, 2) + (rays.sigma_mm[rows] ** 2)[:, :, None] * np.eye(2)
        return computed - rays.xy_mm[rows], J, np.asarray(np.linalg.inv(C), dtype=np.float64)

    N = np.zeros((n_points, 3, 3))
    for _ in range(MOST_ITERATIONS):
        v, J, W = linearised(use)
        N, right = np.zeros((n_points, 3, 3)), np.zeros((n_points, 3))
        np.add.at(N, point[use], J.swapaxes(1, 2) @ W @ J)
        np.add.at(right, point[use], np.einsum("nji,njk,nk->ni", J, W, v))
        values = np.linalg.eigvalsh(N)
        solvable = (values[:, 2] > 0) & (values[:, 0] > OPEN * values[:, 2])
        step = np.zeros((n_points, 3))
        step[solvable] = -np.linalg.solve(N[solvable], right[solvable][:, :, None])[:, :, 0]
        xyz = np.where(solvable[:, None], xyz + step, np.nan)
        if np.sqrt(np.einsum("ni,nij,nj->n", step, N, step).max(initial=0.0)) < SETTLED:
            break
    intersected = finite_rows(xyz)
    covariance_m2 = np.full((n_points, 3, 3), np.nan)
    covariance_m2[intersected] = np.linalg.inv(N[intersected])
    use = use[intersected[point[use]]]
    v, _, W = linearised(use)
    whitened, residual, sigma = (np.full((len(image), 2), np.nan) for _ in range(3))
    residual[use], whitened[use] = v, np.einsum("nji,nj->ni", np.linalg.cholesky(W), v)
    sigma[use] = np.sqrt(np.einsum("nii->ni", np.linalg.inv(W)))
    used = np.isin(np.arange(len(image)), use)
    count = np.bincount(point[use], minlength=n_points)
    return UncertainIntersection(xyz, covariance_m2, count, whitened, residual, sigma, used)
