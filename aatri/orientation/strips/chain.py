"""Free strips: models chained through their common images.

The strip frame is that of the first image, the unit of length the base of the first model. With the scale m_k of model
k (the product of the scale factors of all joints before it), rotations and projection centres follow one another:

    R_(k+1) = R_k R_rel,   X0_(k+1) = X0_k + m_k R_k b,   X = X0_k + m_k R_k x

A point of several models is the mean of its positions, weighted by the inverse of their covariances.

Source: photogrammetry.md A404-A410.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aatri.arrays import Float, Int
from aatri.orientation.strips.scale_transfer import Joint, Model


@dataclass(frozen=True)
class FreeStrip:
    """A free strip.

    Attributes
    ----------
    position : (k + 1, 3) float64
        Projection centres, in the unit of the first base.
    strip_from_image : (k + 1, 3, 3) float64
    scale : (k,) float64
        Scale of each model.
    point : (n,) int
    xyz : (n, 3) float64
    covariance : (n, 3, 3) float64
        From the image coordinates, orientations held.
    models : (n,) int
        Models that hold the point.
    discrepancy : tuple of (c, 3) float64
        Per joint: its points, second minus first model.
    """

    position: Float
    strip_from_image: Float
    scale: Float
    point: Int
    xyz: Float
    covariance: Float
    models: Int
    discrepancy: tuple[Float, ...]


def form_strip(models: Sequence[Model], joints: Sequence[Joint]) -> FreeStrip:
    """Chain models to a strip.

    Parameters
    ----------
    models : sequence of Model
        In order; the right image of one is the left image of the next.
    joints : sequence of Joint
        Joint k connects models k and k + 1; points rejected there are left out of both models.
    """
    position, rotation, scale = [np.zeros(3)], [np.eye(3)], [1.0]
    for k, model in enumerate(models):
        position.append(position[k] + scale[k] * rotation[k] @ model.base)
        rotation.append(rotation[k] @ model.left_from_right)
        if k < len(joints):
            scale.append(scale[k] * joints[k].scale)
    placed = [position[k] + scale[k] * model.xyz @ rotation[k].T for k, model in enumerate(models)]
    point, xyz, covariance, count = _means(models, joints, placed, rotation, scale)
    return FreeStrip(
        np.array(position), np.array(rotation), np.array(scale), point, xyz, covariance, count,
        tuple(_discrepancies(models[k : k + 2], placed[k : k + 2], joint) for k, joint in enumerate(joints)),
    )  # fmt: skip


def _discrepancies(models: Sequence[Model], placed: Sequence[Float], joint: Joint) -> Float:
    first, second = (x[np.searchsorted(model.point, joint.point)] for model, x in zip(models, placed))
    return np.asarray(second - first)


def _means(
    models: Sequence[Model], joints: Sequence[Joint], placed: list[Float], rotation: list[Float], scale: list[float]
) -> tuple[Int, Float, Float, Int]:
    """Weighted means of the points over their models."""
    points, positions, weights = [], [], []
    for k, model in enumerate(models):
        rejected = [joint.point[~joint.active] for joint in joints[max(k - 1, 0) : k + 1]]
        use = ~np.isin(model.point, np.concatenate([np.zeros(0, dtype=np.int32), *rejected]))
        R = rotation[k]
        points.append(model.point[use])
        positions.append(placed[k][use])
        weights.append(np.linalg.inv(scale[k] ** 2 * (R @ model.covariance[use] @ R.T)))
    point, row, count = np.unique(np.concatenate(points), return_inverse=True, return_counts=True)
    x, weight = np.concatenate(positions), np.concatenate(weights)
    normal, moment = np.zeros((len(point), 3, 3)), np.zeros((len(point), 3))
    first = np.zeros((len(point), 3))
    first[row[::-1]] = x[::-1]
    np.add.at(normal, row, weight)
    np.add.at(moment, row, np.einsum("nij,nj->ni", weight, x - first[row]))
    covariance = np.asarray(np.linalg.inv(normal), dtype=np.float64)
    return point, first + np.einsum("nij,nj->ni", covariance, moment), covariance, count
