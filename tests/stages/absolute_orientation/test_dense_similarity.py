"""The similarity of a strip beside dense least squares of its seven parameters."""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from aatri.stages.absolute_orientation.similarity import SimilarityOptions, similarity
from tests.made_strips import MadeBlock


def test_full_plan_and_height_control_give_the_similarity_of_dense_least_squares() -> None:
    """X - T - s R x over the given coordinates, with the covariances s^2 R C R' + tau^2 + sigma^2 of the end.

    The start by two points levels a strip by its images, degrees off: its result is no other.
    """
    made = MadeBlock(1, 6, seed=4, noise_m=0.012)
    a, b, c, d = made.corners()
    made.control([a, d], sigma_m=0.02).control([b], (1, 1, 0), 0.02).control([c, 9], (0, 0, 1), 0.03)
    made.control([17], (1, 1, 0), 0.04)
    chosen = SimilarityOptions(start="two_points")
    solution = similarity(made.block(), made.strips(), made.image_points(), options=chosen)
    points = made.strips().strip_points
    x, C = (dict(zip(points.point.tolist(), of)) for of in (points.xyz, points.covariance))
    (tau,) = solution.parameters.value[solution.parameters.name == "tau_m"]
    scale, R0 = 1 / made.frames[0][1], Rotation.from_matrix(made.frames[0][2].T)
    centre = np.mean([*x.values()], axis=0)
    middle = made.truth.mean(axis=0)

    def on_ground(z: np.ndarray, of: np.ndarray) -> np.ndarray:
        return middle + z[:3] + scale * np.exp(z[6]) * (Rotation.from_rotvec(z[3:6]) * R0).apply(of - centre)

    def residuals(z: np.ndarray, end: np.ndarray) -> np.ndarray:
        M = scale * np.exp(end[6]) * (Rotation.from_rotvec(end[3:6]) * R0).as_matrix()
        parts = []
        for p, (roles, given, sigma) in made.given.items():
            use = roles == 1
            W = (M @ C[p] @ M.T + (tau**2 + sigma**2) * np.eye(3))[np.ix_(use, use)]
            parts.append(np.linalg.solve(np.linalg.cholesky(W), (given - on_ground(z, x[p][None])[0])[use]))
        return np.concatenate(parts)

    z = np.zeros(7)
    for _ in range(4):
        z = least_squares(residuals, z, args=(z,), x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    rows = points.point.tolist()
    np.testing.assert_allclose(solution.points.xyz_m[rows], on_ground(z, points.xyz), rtol=0, atol=1e-5)
