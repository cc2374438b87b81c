"""Errors of the exterior orientation: against the truth of a simulated block, and against observed positions.

The rotation error of an image is the vector d of R = exp([d]x) R_true, on the ground side, and its size |d| the angle
between both attitudes. Its theoretical counterpart is sqrt(trace C_dd).

An observed position is that of the projection centre, X0, or of the antenna, X0 + R a with the lever arm a in camera
axes. Shift and drift are not taken off: they are part of the difference.
"""

import numpy as np

from aatri.arrays import Float
from aatri.artifacts.block import ANTENNA, OBSERVED_VALUE, Block
from aatri.artifacts.solution import Solution
from aatri.evaluation.statistics import bias, largest, rmse
from aatri.geometry.rotations import log_rotation

AXES = "xyz"


def true_orientation_figures(block: Block, solution: Solution) -> dict[str, float]:
    """Errors of the orientations against the truth; nothing without truth or oriented images.

    Returns
    -------
    dict
        `truth_position_rmse_x_m`, `truth_position_max_m`, `truth_rotation_rmse_rad`, `truth_rotation_max_rad`
        and, where covariances exist, `theory_position_rmse_x_m`, `theory_rotation_rmse_rad`.
    """
    if block.true_images is None:
        return {}
    images = solution.images
    oriented = images.oriented[block.true_images.image]
    rows, true = block.true_images.image[oriented], block.true_images.take(oriented)
    if not len(rows):
        return {}
    position = images.position_m[rows] - true.position_m
    turn = log_rotation(images.ground_from_image[rows] @ true.ground_from_image.swapaxes(1, 2))
    angle = np.linalg.norm(turn, axis=1)[:, None]
    variance = np.einsum("nii->ni", images.covariance[rows])
    sigma_angle = np.sqrt(variance[:, 3:].sum(axis=1))[:, None]
    return {
        **by_axis("truth_position_rmse_{}_m", rmse(position)),
        "truth_position_max_m": float(largest(position.reshape(-1, 1))[0]),
        "truth_rotation_rmse_rad": float(rmse(angle)[0]),
        "truth_rotation_max_rad": float(largest(angle)[0]),
        **by_axis("theory_position_rmse_{}_m", rmse(np.sqrt(variance[:, :3]))),
        "theory_rotation_rmse_rad": float(rmse(sigma_angle)[0]),
    }


def observed_position_figures(block: Block, solution: Solution) -> dict[str, float]:
    """Solution minus observed projection centres (GNSS).

    Returns
    -------
    dict
        `position_rmse_x_m` and `position_bias_x_m`; nothing without observed positions.
    """
    rows = block.exterior.position_use == OBSERVED_VALUE
    rows &= solution.images.oriented[block.exterior.image]
    if not rows.any():
        return {}
    exterior = block.exterior.take(rows)
    lever = block.cameras.lever_arm_m[block.images.camera[exterior.image]]
    offset = np.einsum("nij,nj->ni", solution.images.ground_from_image[exterior.image], lever)
    offset[exterior.refers_to != ANTENNA] = 0.0
    difference = solution.images.position_m[exterior.image] + offset - exterior.position_m
    return {**by_axis("position_rmse_{}_m", rmse(difference)), **by_axis("position_bias_{}_m", bias(difference))}


def by_axis(name: str, values: Float) -> dict[str, float]:
    """Figures of X, Y and Z by their names."""
    return {name.format(axis): float(value) for axis, value in zip(AXES, values)}
