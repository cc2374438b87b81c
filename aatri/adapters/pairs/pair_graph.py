"""Which images of a block are paired, and Models as the graph of their pairs."""

from __future__ import annotations

import numpy as np

from aatri.arrays import Bool, Int
from aatri.artifacts.models import Models, Turns
from aatri.orientation.graph.pair_graph import PairGraph, RotationPairs

FEWEST = 8
"""Points of a pair that must fit."""


def strongest_pairs(images: Int, common: Int, n_images: int, most: int) -> Bool:
    """The pairs of most common points of every image, (m,).

    Parameters
    ----------
    images : (m, 2) int
    common : (m,) int
    most : int
        Pairs of each image; a pair stays if it is among those of either image.
    """
    ends, m = images.T.ravel(), len(images)
    order = np.lexsort((np.tile(np.arange(m), 2), -np.tile(common, 2), ends))
    rank = np.arange(2 * m) - np.searchsorted(ends[order], np.arange(n_images))[ends[order]]
    kept = np.zeros(m, dtype=bool)
    kept[order[rank < most] % max(m, 1)] = True
    return kept


def turns_of(models: Models) -> RotationPairs:
    """Pairs of which the rotation is known and nothing else."""
    t = models.turns if models.turns is not None else Turns.empty()
    return RotationPairs(
        t.left.astype(np.int64), t.right.astype(np.int64), t.left_from_right, t.sigma_rad, t.points.astype(np.int64)
    )


def graph_of(models: Models, fewest: int = FEWEST) -> tuple[PairGraph, Int]:
    """The graph of models with enough points that fit, and their rows in the orientations."""
    o, p = models.orientations, models.model_points
    order = np.lexsort((p.point, p.model))
    order = order[p.active[order]]
    count = np.bincount(p.model[order], minlength=len(o))
    kept = np.flatnonzero(count >= fewest)
    rows = order[np.isin(p.model[order], kept)]
    base = o.base[p.model[rows]]
    left, right = p.xyz[rows], p.xyz[rows] - base
    depth = np.column_stack([np.linalg.norm(left, axis=1), np.linalg.norm(right, axis=1)])
    across = np.linalg.norm(np.cross(left, right), axis=1)
    variance = [np.linalg.eigvalsh(c)[:, -1] if len(kept) else np.zeros(0)
                for c in (o.covariance[kept, :3, :3], o.covariance[kept, 3:, 3:])]  # fmt: skip
    second = np.full((len(o), 3, 3), np.nan)
    if models.second_orientations is not None:
        second[models.second_orientations.model] = models.second_orientations.left_from_right
    return PairGraph(
        len(models.images), o.left[kept].astype(np.int64), o.right[kept].astype(np.int64), o.left_from_right[kept],
        o.base[kept], np.sqrt(variance[0]), np.sqrt(variance[1]),
        np.concatenate([[0], np.cumsum(count[kept])]).astype(np.int64), p.point[rows].astype(np.int64), depth,
        np.arctan2(across, np.einsum("ni,ni->n", left, right)), second[kept],
    ), kept  # fmt: skip
