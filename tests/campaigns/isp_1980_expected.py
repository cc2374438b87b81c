"""What additional parameters gain by the laws of propagation alone, without an adjustment.

    x = K l,   K = Q_p A'P,   Q = (A'PA)^-1,   E RMSE^2 = mean over the points of (K d)^2 + diag(Q_p)

A of all unknowns (poses, the film's affine terms of each image with the weight of its fiducials, points, a set of
parameters with its a-priori standard deviation) at the truth, by complex step, in dense matrices; d the camera's
deformation at the image points. A set takes out of d what it can describe, and pays with the noise of its unknowns:

    gain = 1 - sqrt((bias^2 + noise^2) with the set / (bias^2 + noise^2) without)

The sets are written out here once more: Brown and Conrady, Ebner 1976 (b the photo base), Bauer (r0^2 = E r^4 / E r^2
over the format). K of the block's own observations gives what its adjustment must.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.codes import CONTROL
from tests.dense_bundle import brown_residual, by_complex_step

C_MM, HALF_MM, BASE_MM = 153.84, 115.0, 92.0
RADIUS_MM = HALF_MM * np.sqrt(2)

SIGMA_MM = 0.05
"""A-priori standard deviation of each parameter at the border."""


def basis(name: str, xy_mm: np.ndarray) -> np.ndarray:
    """Corrections (n, 2, k), mm, of a set of k parameters, each one mm or less in the format."""
    x, y = xy_mm.T / (BASE_MM if name == "ebner12" else RADIUS_MM)
    zero, one, r2 = np.zeros_like(x), np.ones_like(x), x * x + y * y
    if name == "ebner12":
        u, v = x * x - 2 / 3, y * y - 2 / 3
        dx = [x, y, -2 * u, x * y, v, zero, x * v, zero, y * u, zero, u * v, zero]
        dy = [-y, x, x * y, -2 * v, zero, u, zero, y * u, zero, x * v, zero, u * v]
    elif name == "bauer3":
        radial = r2 - (2 / 5 + 2 / 9) / (2 / 3) * (HALF_MM / RADIUS_MM) ** 2
        dx, dy = [x * radial, zero, -x], [y * radial, x, y]
    else:
        c = C_MM / RADIUS_MM
        dx = [-x / c, -one, zero, x * r2, x * r2**2, x * r2**3, r2 + 2 * x * x, 2 * x * y, x, y]
        dy = [-y / c, zero, -one, y * r2, y * r2**2, y * r2**3, 2 * x * y, r2 + 2 * y * y, zero, zero]
    return np.stack([np.stack(dx, axis=1), np.stack(dy, axis=1)], axis=1)


@dataclass(frozen=True)
class Propagation:
    """From the image points of a block to its ground points."""

    K: np.ndarray
    """(3 n, 2 m), m per mm."""
    of_control_m: np.ndarray
    """(3 n,), m. What the errors of the control points of this block do."""
    noise_m2: np.ndarray
    """(3,). Mean variance of the points, X, Y, Z."""

    def bias_m2(self, d_mm: np.ndarray) -> np.ndarray:
        """Mean square of what a deformation d, (m, 2), does to the points, X, Y, Z."""
        return ((self.K @ d_mm.ravel()).reshape(-1, 3) ** 2).mean(axis=0)

    def rmse_m(self, l_mm: np.ndarray) -> np.ndarray:
        """Of the points by the block's own observations less what the truth gives, (m, 2), X, Y, Z."""
        error_m = self.K @ l_mm.ravel() + self.of_control_m
        return np.sqrt((error_m.reshape(-1, 3) ** 2).mean(axis=0))


def projected(block: Block, refined: ImagePoints) -> np.ndarray:
    """Image points of the truth, (m, 2), mm."""
    assert block.true_images is not None
    assert block.true_points is not None
    rays = refined.measurements
    R = block.true_images.ground_from_image[rays.image]
    u = np.einsum("nji,nj->ni", R, block.true_points.xyz_m[rays.point] - block.true_images.position_m[rays.image])
    return np.asarray(-C_MM * u[:, :2] / u[:, 2:])


def propagations(block: Block, refined: ImagePoints, sets: tuple[str, ...]) -> dict[str | None, Propagation]:
    """Without parameters (None) and with each set."""
    A, weight, N, right = _normal_equations(block, refined)
    images, rays = len(block.images), refined.measurements
    xy_mm, before = projected(block, refined), 12 * images
    found: dict[str | None, Propagation] = {}
    for name in (None, *sets):
        J, whole = A, N
        if name is not None:
            G = -basis(name, xy_mm).reshape(2 * len(rays), -1)
            J = np.hstack([A, G])
            whole = np.block([[N, A.T @ (weight * G)], [G.T @ (weight * A), G.T @ (weight * G)]])
            whole[len(N) :, len(N) :] += np.eye(G.shape[1]) / SIGMA_MM**2
        scale = 1.0 / np.sqrt(np.diag(whole))
        Q = np.linalg.inv(whole * np.outer(scale, scale)) * np.outer(scale, scale)
        of_points = Q[before : len(N)]
        noise = np.diag(of_points[:, before : len(N)]).reshape(-1, 3).mean(axis=0)
        found[name] = Propagation(of_points @ (weight * J).T, of_points[:, : len(N)] @ right, noise)
    return found


def _normal_equations(block: Block, refined: ImagePoints) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """A of the image points, their weights as a column, N with fiducials and control, and A'Pl of the control."""
    assert block.true_images is not None
    assert block.true_points is not None
    rays, truth = refined.measurements, block.true_points.xyz_m
    images, n, m = len(block.images), len(truth), len(rays)
    R, xy_mm = block.true_images.ground_from_image[rays.image], projected(block, refined)
    camera = np.tile([C_MM, *np.zeros(9)], (m, 1))
    at = np.column_stack([block.true_images.position_m[rays.image], np.zeros((m, 3)), truth[rays.point]])
    J = by_complex_step(lambda z: brown_residual(z, R, xy_mm, camera), at)
    A, r = np.zeros((2 * m, 12 * images + 3 * n)), np.arange(m)
    film = np.column_stack([np.ones(m), xy_mm])
    for axis in range(2):
        for k in range(6):
            A[2 * r + axis, 6 * rays.image + k] = J[:, axis, k]
        for k in range(3):
            A[2 * r + axis, 6 * images + 6 * rays.image + 3 * axis + k] = film[:, k]
            A[2 * r + axis, 12 * images + 3 * rays.point + k] = J[:, axis, 6 + k]
    weight = 1.0 / rays.sigma_mm.ravel()[:, None] ** 2
    N, right = A.T @ (weight * A), np.zeros(A.shape[1])
    marks = np.column_stack([np.ones(len(block.fiducials)), block.fiducials.xy_mm])
    N_film = marks.T @ marks / block.fiducial_points.sigma_mm[0, 0] ** 2
    for k in range(6 * images, 12 * images, 3):
        N[k : k + 3, k : k + 3] += N_film
    ground = block.ground_points
    for row, axis in np.argwhere(ground.role == CONTROL):
        k, point = 12 * images + 3 * ground.point[row] + axis, ground.point[row]
        N[k, k] += 1.0 / ground.covariance_m2[row, axis, axis]
        right[k] += (ground.xyz_m[row, axis] - truth[point, axis]) / ground.covariance_m2[row, axis, axis]
    return A, weight, N, right
