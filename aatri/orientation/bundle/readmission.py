"""Re-admission: rays that an earlier stage rejected are held against the adjusted block.

A rejected ray of an adjusted image and point has the prediction error v with covariance

    S = sigma^2 + Jx Qx Jx' + Jp Qp Jp',

Qx and Qp the covariances of pose and point; their correlation is left out, so that S is approximate, but
never smaller than sigma^2. It is re-admitted if v'S^-1 v / 2 is within `limit` squared.
"""

from __future__ import annotations

import numpy as np

from aatri.arrays import Bool
from aatri.geometry.collinearity import collinearity
from aatri.observations.image_points import ImagePointRows
from aatri.orientation.bundle.adjust import BundleResult


def readmitted(rays: ImagePointRows, rejected: Bool, result: BundleResult, limit: float = 3.0) -> Bool:
    """Which of the rejected rays fit the adjusted block after all.

    Parameters
    ----------
    rays : ImagePointRows
        All rays.
    rejected : (n,) bool
    result : BundleResult
    limit : float
        In standard deviations.

    Returns
    -------
    (n,) bool
    """
    test = rejected & result.image_adjusted[rays.image] & result.point_adjusted[rays.point]
    rows = np.flatnonzero(test)
    image, point = rays.image[rows], rays.point[rows]
    X0, R = result.poses.position_m[image], result.poses.ground_from_image[image]
    xy, by_pose, by_point = collinearity(X0, R, result.xyz_m[point], rays.c_mm[rows])
    v = xy - rays.xy_mm[rows]
    S = rays.sigma_mm[rows][:, :, None] ** 2 * np.eye(2)
    for J, Q in ((by_pose, result.pose_covariance[image]), (by_point, result.point_covariance_m2[point])):
        S = S + J @ np.nan_to_num(Q) @ J.swapaxes(1, 2)
    size = np.einsum("ni,nij,nj->n", v, np.linalg.inv(S), v) / 2
    fits = np.zeros(len(test), dtype=bool)
    fits[rows[size <= limit**2]] = True
    return fits
