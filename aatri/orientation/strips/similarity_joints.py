"""Models joined by a similarity: turn and scale of the second model from the common points alone.

About the common projection centre, in the frame of the common image of the first model, a common point is y_a in the
unit of the first model and x_b in that of the second:

    y_a = lambda T x_b,   new base = lambda T b

T (3 unknowns) and lambda by weighted least squares with the covariances of both positions, C_a + lambda^2 T C_b T'; all
joints together by Gauss-Newton from T = I and the scale of `scale_transfer`, whose rejections are kept. The rotation of
the common image, which chaining through the image takes as it is, is left out: for models that are independent of one
another. The turn about the row of connection points is weak: it rests on their distance from the centre.

Source: docs/formulas.md 3.6 (the notes' connection of independent models, A407).
"""

from dataclasses import replace

import numpy as np

from aatri.arrays import Float, Int
from aatri.geometry.rotations import exp_rotation
from aatri.geometry.similarity import motions
from aatri.orientation.strips.joints import JointTable, ModelTable

ITERATIONS = 20
SETTLED = 1e-12


def similarity_joints(models: ModelTable, joints: JointTable) -> JointTable:
    """The joints with turn and scale of a similarity; those with fewer than two points used keep what they have."""
    rows = np.flatnonzero(joints.active)
    joint = joints.of_row()[rows]
    enough = joints.used() >= 2
    rows, joint = rows[enough[joint]], joint[enough[joint]]
    turn, scale, sigma = np.tile(np.eye(3), (len(joints.first), 1, 1)), joints.scale.copy(), joints.sigma.copy()
    if not len(rows):
        return replace(joints, turn=turn)
    chosen = np.flatnonzero(enough)
    place, first = np.searchsorted(chosen, joint), np.searchsorted(joint, chosen)
    y, C_a = _in_common_image(models, joints, rows, joint)
    x, C_b = models.xyz[joints.second_row[rows]], models.covariance[joints.second_row[rows]]
    T, s = turn[chosen], np.log(scale[chosen])
    for _ in range(ITERATIONS):
        m, R = np.exp(s)[place], T[place]
        moved = m[:, None] * (R @ x[:, :, None])[:, :, 0]
        weight = np.linalg.inv(C_a + (m**2)[:, None, None] * (R @ C_b @ R.swapaxes(1, 2)))
        J = motions(moved)[:, :, 3:]
        JW = J.swapaxes(1, 2) @ weight
        N = np.add.reduceat(JW @ J, first)
        step = np.linalg.solve(N, np.add.reduceat(JW @ (y - moved)[:, :, None], first))[:, :, 0]
        T, s = exp_rotation(step[:, :3]) @ T, s + step[:, 3]
        if np.abs(step).max() < SETTLED:
            break
    turn[chosen], scale[chosen] = T, np.exp(s)
    sigma[chosen] = scale[chosen] * np.sqrt(np.linalg.inv(N)[:, 3, 3])
    return replace(joints, turn=turn, scale=scale, sigma=sigma)


def _in_common_image(models: ModelTable, joints: JointTable, rows: Int, joint: Int) -> tuple[Float, Float]:
    """Common points of the first models about the common projection centre, in the frame of the common image."""
    a = joints.first[joint]
    R = models.left_from_right[a].swapaxes(1, 2)
    at = joints.first_row[rows]
    y = (R @ (models.xyz[at] - models.base[a])[:, :, None])[:, :, 0]
    return y, R @ models.covariance[at] @ R.swapaxes(1, 2)
