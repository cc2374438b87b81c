"""Free strips: models chained through their common images.

The strip frame is that of the first image, the unit of length the base of the first model. With the scale m_k of model
k (the product of the scale factors of all joints before it), rotations and projection centres follow one another:

    R_(k+1) = R_k R_rel,   X0_(k+1) = X0_k + m_k R_k b,   X = X0_k + m_k R_k x

A point of several models is the mean of its positions, weighted by the inverse of their covariances.

Source: Kraus, Photogrammetry, strips; docs/formulas.md 3.6.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aatri.adjustment.threads import by_rows, in_threads
from aatri.arrays import Float, Int
from aatri.orientation.strips.joints import WORTH_A_THREAD, JointTable, ModelTable
from aatri.orientation.strips.kernels.means import means


@dataclass(frozen=True)
class ChainedModels:
    """Free strips, one after the other."""

    image_strip: Int
    """(i,) int64. Strip of each projection centre; a strip has one more than models."""
    position: Float
    """(i, 3). Projection centres, in the unit of the strip's first base."""
    strip_from_image: Float
    """(i, 3, 3)."""
    strip: Int
    point: Int
    """(n,) int64. Strip and point of each strip point, ascending."""
    xyz: Float
    """(n, 3)."""
    covariance: Float
    """(n, 3, 3). From the image coordinates, orientations held."""
    models: Int
    """(n,) int64. Models that hold the point."""
    placed: Float
    """(k, 3). All points of all models in their strips; NaN where the model is in none."""


def form_strips(
    models: ModelTable, joints: JointTable, chains: Sequence[tuple[Sequence[int], Sequence[int]]]
) -> ChainedModels:
    """Chain models to strips.

    Parameters
    ----------
    chains : sequence of (models, joints)
        Rows of the models of each strip in order, the right image of one being the left image of the next, and of the
        joints between them. Points rejected at a joint are left out of both its models.
    """
    count = np.array([len(chain) for chain, _ in chains], dtype=np.int64)
    order = np.array([k for chain, _ in chains for k in chain], dtype=np.int64)
    used = np.array([k for _, chain in chains for k in chain], dtype=np.int64)
    position, rotation, of_model, scale = _followed(models, joints, count, order, used)
    strip_of_model = np.repeat(np.arange(len(chains)), count)
    in_model = np.arange(len(order)) + strip_of_model  # each strip has one image more than models
    place, (strip, m, R, X0) = np.zeros(len(models.base), dtype=np.int64), _nowhere(len(models.base))
    place[order], strip[order], m[order] = np.arange(len(order)), strip_of_model, scale
    R[order], X0[order] = of_model, position[in_model]
    of_row = models.of_row()

    def in_strip(model: Int, xyz: Float) -> Float:
        return np.asarray(X0[model] + m[model][:, None] * (R[model] @ xyz[:, :, None])[:, :, 0])

    placed = by_rows(in_strip, of_row, models.xyz)
    use = strip[of_row] >= 0
    rejected = ~joints.active & np.isin(joints.of_row(), used)
    use[joints.first_row[rejected]] = use[joints.second_row[rejected]] = False
    rows = np.flatnonzero(use)
    rows = rows[np.argsort(place[of_row[rows]], kind="stable")]
    means = _means(strip, models, rows, m, R, placed)
    return ChainedModels(np.repeat(np.arange(len(chains)), count + 1), position, rotation, *means, placed)


def _nowhere(n: int) -> tuple[Int, Float, Float, Float]:
    """Strip, scale, rotation and place of models that are in no strip."""
    return np.full(n, -1), np.full(n, np.nan), np.full((n, 3, 3), np.nan), np.full((n, 3), np.nan)


def _followed(
    models: ModelTable, joints: JointTable, count: Int, order: Int, used: Int
) -> tuple[Float, Float, Float, Float]:
    """Projection centres and rotations of images, rotations and scales of models; one model farther at a time."""
    n = len(count)
    first_image, first_model = np.cumsum(count + 1) - count - 1, np.cumsum(count) - count
    first_joint = first_model - np.arange(n)
    position, rotation = np.zeros((int(count.sum()) + n, 3)), np.zeros((int(count.sum()) + n, 3, 3))
    rotation[first_image] = np.eye(3)
    scale, of_model = np.ones(len(order)), np.zeros((len(order), 3, 3))
    for k in range(int(count.max(initial=0))):
        on = np.flatnonzero(count > k)
        image, place = first_image[on] + k, first_model[on] + k
        model = order[place]
        R = rotation[image]
        if k > 0:
            joint = used[first_joint[on] + k - 1]
            scale[place] = scale[place - 1] * joints.scale[joint]
            R = R if joints.turn is None else R @ joints.turn[joint]
        of_model[place] = R
        position[image + 1] = position[image] + scale[place][:, None] * (R @ models.base[model][:, :, None])[:, :, 0]
        rotation[image + 1] = R @ models.left_from_right[model]
    return position, rotation, of_model, scale


def _means(
    strip: Int, models: ModelTable, rows: Int, scale: Float, rotation: Float, placed: Float
) -> tuple[Int, Int, Float, Float, Int]:
    """Weighted means of the points of each strip over its models: strip, point, mean, covariance, models."""
    model = np.ascontiguousarray(models.of_row(), dtype=np.int64)
    rows = np.ascontiguousarray(rows[np.lexsort((models.point[rows], strip[model[rows]]))])
    of_strip, point = strip[model[rows]], models.point[rows]
    new = np.flatnonzero(np.concatenate([[True], (np.diff(of_strip) != 0) | (np.diff(point) != 0)])[: len(rows)])
    start, n = np.append(new, len(rows)), len(new)
    mean, covariance_of_mean = np.empty((n, 3)), np.empty((n, 3, 3))
    covariance = np.require(models.covariance, np.float64, ["C", "W"])

    def part(first: int, last: int) -> None:
        means(first, last, start, rows, model, scale, rotation, covariance, placed, mean, covariance_of_mean)

    in_threads(n, part, worth=WORTH_A_THREAD)
    return of_strip[new].astype(np.int64), point[new].astype(np.int64), mean, covariance_of_mean, np.diff(start)
