"""Collinearity in object space: image points as conditions that no perspective division makes steep.

    v = (c u1 + x u3) / D,   (c u2 + y u3) / D,       u = R'(X - X0),   D a fixed distance

v is zero where the point lies on its ray, and of the size of the residual in the image where the point is about D away.
For given rotations it is linear in X and X0, has no pole where a point passes through the plane of the camera, and so
leads from starts that the image residual does not. It does not know front from behind, and weighs near and far rays
as if all were D long: it gives start values, never results.

Source: the object-space error of Lu, Hager & Mjolsness 2000; Hong et al. 2016 for whole blocks.
"""

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State
from aatri.arrays import Float, Int
from aatri.geometry.rotations import skew
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.poses import POINT, POSE, Poses


def object_space_records(rays: ImagePointRows, distance_m: float, factor: float) -> Records:
    """Records of all rays.

    Parameters
    ----------
    distance_m : float, m
        D, as of the median ray.
    factor : float
        On the standard deviations of the image points: above 1 control and observed positions come first.
    """
    image, point = np.asarray(rays.image, dtype=np.int32), np.asarray(rays.point, dtype=np.int32)
    looking = np.zeros((len(image), 2, 3))
    looking[:, 0, 0] = looking[:, 1, 1] = rays.c_mm / distance_m
    looking[:, :, 2] = rays.xy_mm / distance_m

    def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        poses: Poses = state[POSE]
        A = looking[rows] @ poses.ground_from_image[image[rows]].swapaxes(1, 2)
        ray = state[POINT][point[rows]] - poses.position_m[image[rows]]
        return np.einsum("nij,nj->ni", A, ray), (np.concatenate([-A, A @ skew(ray)], axis=2), A)

    whitener = 1.0 / (factor * rays.sigma_mm)
    return Records("image point in space", ((POSE, image), (POINT, point)), evaluate, whitener, rays.active.copy())
