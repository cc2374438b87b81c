"""Double models as units of the block adjustment: two neighbouring models as one rigid body.

The second model is laid onto the first about the image they share, whose rotation in the first is known,

    x_a = b_a + s R_a x_b,      s the median of |x_a - b_a| / |x_b| over their common points;

points of both are weighted means there, and the body has three perspective centres. A strip of an odd number of models
ends with a single one, and so does a pair of too few common points. Half as many bodies, each stiffer along the strip.

Source: lecture notes A801, where the unit is a single or a double model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from aatri.adjusting.added_variance import weighted_means
from aatri.adjustment.whitening import inverse_cholesky
from aatri.arrays import Int
from aatri.geometry.similarity import IDENTITY, Similarity, transform, transform_covariance
from aatri.orientation.bodies.model_ties import LATENT, ModelRows

if TYPE_CHECKING:
    from aatri.artifacts.models import Models

FEWEST = 3
"""Common points from which on two models make one."""

Unit = tuple[int, ...]
"""Rows of one or two models."""


def double_units(models: Models, chosen: Int) -> dict[Unit, Similarity]:
    """Chosen models in pairs of neighbours, first come first; the second of each pair in the first, else identity."""
    o, units = models.orientations, dict[Unit, Similarity]()
    left, beginning = set(chosen.tolist()), dict[int, list[int]]()
    for k in chosen.tolist():
        beginning.setdefault(int(o.left[k]), []).append(k)
    ends = set(o.right[chosen].tolist())
    order = sorted(chosen.tolist(), key=lambda k: (int(o.left[k]) in ends, k))  # strips from their beginning
    for first in order:
        k = first
        while k in left:
            left.remove(k)
            after = [n for n in beginning.get(int(o.right[k]), []) if n in left]
            joined = next(((n, to) for n in after if (to := _joined(models, k, n)) is not None), None)
            units[(k,) if joined is None else (k, joined[0])] = IDENTITY if joined is None else joined[1]
            last = k if joined is None else joined[0]
            left.discard(last)
            k = next((n for n in beginning.get(int(o.right[last]), []) if n in left), -1)
    return dict(sorted(units.items()))


def _joined(models: Models, a: int, b: int) -> Similarity | None:
    """Model b in model a, whose right image is its left one; None with too few common points."""
    o, p = models.orientations, models.model_points
    rows_a, rows_b = (np.flatnonzero((p.model == k) & p.active) for k in (a, b))
    _, in_a, in_b = np.intersect1d(p.point[rows_a], p.point[rows_b], return_indices=True)
    if len(in_a) < FEWEST:
        return None
    away = np.linalg.norm(p.xyz[rows_a[in_a]] - o.base[a], axis=1)
    scale = float(np.median(away / np.linalg.norm(p.xyz[rows_b[in_b]], axis=1)))
    return Similarity(o.base[a], scale, o.left_from_right[a])


def merged(rows: ModelRows, unit: Int, to: Sequence[Similarity]) -> ModelRows:
    """Rows in the axes of their units, (m,) of each model, one for each point of a unit: its weighted mean."""
    x, C = rows.x.copy(), rows.covariance.copy()
    for k, similarity in enumerate(to):
        if similarity is not IDENTITY:
            of_model = rows.model == k
            x[of_model], C[of_model] = transform(similarity, x[of_model]), transform_covariance(similarity, C[of_model])
    key, group = np.unique(np.stack([unit[rows.model], rows.block], axis=1), axis=0, return_inverse=True)
    use = np.ones(len(x), dtype=bool)
    mean, covariance = weighted_means(group.ravel(), x, inverse_cholesky(C), use, len(key))
    return replace(
        rows, model=key[:, 0], block=key[:, 1], x=mean, covariance=covariance, by_latent=np.zeros((len(key), 3, LATENT))
    )
