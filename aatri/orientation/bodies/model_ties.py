"""Independent models as bodies: points and perspective centres of each model go to the ground by one similarity.

    x_o = T_m + s_m R_m (x + J_x e_m),     e_m ~ N(0, I)

x are coordinates in the model, base 1: its points, and its two perspective centres (0 and b). The seven unknowns are
those of `similarity_ties`. e_m, five latent unknowns, is the error of the model's relative orientation in units of its
standard deviations: C = W W' its covariance, J_x = (dx / d(d, t)) W. Points and centres of a model share it, so that
its bend is neither taken for gross errors nor counted as independent errors of the points. Along the left ray a point
moves with the orientation as `strips.model_errors` has it; the left centre stays, the right one moves by T t.

Without latent unknowns the centres have a standard deviation of their own, the classical form.

Source: Ackermann, Ebner & Klein 1970 (independent models); docs/formulas.md 4.5; lecture notes A801-A805, erratum E15.

Of a double model, two neighbouring models as one rigid body, the second is laid onto the first about the image they
share, whose rotation in the first is known,

    x_a = b_a + s R_a x_b,      s the median of |x_a - b_a| / |x_b| over their common points;

points of both are weighted means there, and the body has three perspective centres. A strip of an odd number of models
ends with a single one, and so does a pair of too few common points. Half as many bodies, each stiffer along the strip.

Source: lecture notes A801, where the unit is a single or a double model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from aatri.adjusting.added_variance import weighted_means
from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State, Unknowns
from aatri.adjustment.whitening import inverse_cholesky
from aatri.arrays import Float, Int, Text
from aatri.geometry.similarity import IDENTITY, Similarity, motions, transform, transform_covariance
from aatri.observations.observed import Observed, named
from aatri.observations.poses import POINT
from aatri.observations.ties import BODY, Ties
from aatri.orientation.bodies.limits import FEWEST_COMMON_OF_MODELS
from aatri.orientation.bodies.similarity_ties import LABELS, Similarities, moved, turned_spectrum

if TYPE_CHECKING:
    from aatri.artifacts.models import Models


LATENT = 5
LATENT_LABELS = tuple(f"error of the relative orientation {k + 1}" for k in range(LATENT))

PLAN = np.array([1, 1, 0, 0, 0, 1, 1] + [0] * LATENT, dtype=bool)
HEIGHT = np.array([0, 0, 1, 1, 1, 0, 0] + [1] * LATENT, dtype=bool)
"""Unknowns of the plan step (shift, rotation about Z, scale) and of the height step, in order of a model's block."""

Unit = tuple[int, ...]
"""Rows of one or two models."""


@dataclass(frozen=True)
class ModelPoses:
    """Similarities of m models, and their latent errors (m, 5)."""

    similarity: Similarities
    latent: Float


@dataclass(frozen=True)
class ModelRows:
    """Points of models, or their perspective centres."""

    model: Int
    block: Int
    """(n,). Models, and ground points or images."""
    x: Float
    """(n, 3), bases."""
    covariance: Float
    """(n, 3, 3), bases^2. Of the row alone, orientation held."""
    by_latent: Float
    """(n, 3, 5), bases. Zero without latent unknowns."""


def model_ties(rows: ModelRows, *, names: Sequence[str] | Text, latent: bool, group: str = POINT) -> Ties[ModelPoses]:
    """Ties by models.

    Parameters
    ----------
    names : (m,) sequence of str
    latent : bool
        Whether the latent errors are unknowns.
    group : str
        Ground points, or images: of perspective centres.
    """
    m, model = len(names), rows.model.astype(np.int32)
    values, vectors = np.linalg.eigh(rows.covariance)
    values = np.maximum(values, 0.0)

    def bent(state: ModelPoses, chosen: Int) -> Float:
        k = model[chosen]
        return rows.x[chosen] + (rows.by_latent[chosen] @ state.latent[k][:, :, None])[:, :, 0]

    def arms(state: ModelPoses, rows: Int) -> Float:
        k = model[rows]
        turned = (state.similarity.rotation[k] @ bent(state, rows)[:, :, None])[:, :, 0]
        return np.asarray(state.similarity.scale[k][:, None] * turned)

    def on_ground(state: ModelPoses, rows: Int) -> Float:
        return np.asarray(state.similarity.translation[model[rows]] + arms(state, rows))

    def derivatives(state: ModelPoses, chosen: Int) -> Float:
        k = model[chosen]
        sR = state.similarity.scale[k][:, None, None] * state.similarity.rotation[k]
        return np.concatenate([motions(arms(state, chosen)), sR @ rows.by_latent[chosen]], axis=2)

    def spectrum(state: ModelPoses) -> tuple[Float, Float]:
        return turned_spectrum(model, state.similarity, values, vectors)

    one = np.repeat([True, latent], [7, LATENT])
    unknowns = Unknowns(BODY, np.tile(one, (m, 1)), LABELS + LATENT_LABELS, list(map(str, names)), moved_models)
    return Ties(model, rows.block.astype(np.int32), on_ground, derivatives, spectrum, unknowns, group=group)


def moved_models(state: ModelPoses, step: Float) -> ModelPoses:
    """Models after a step (m, 12) of their unknowns."""
    return ModelPoses(moved(state.similarity, step[:, :7]), state.latent + step[:, 7:])


def latent_errors(names: Text) -> Observed:
    """The latent errors of models as observations, zero with standard deviation 1."""
    m, J = len(names), np.concatenate([np.zeros((LATENT, 7)), np.eye(LATENT)], axis=1)

    def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        poses: ModelPoses = state[BODY]
        return poses.latent[rows], (np.broadcast_to(J, (len(rows), *J.shape)),)

    whitener = np.broadcast_to(np.eye(LATENT), (m, LATENT, LATENT))
    touches = ((BODY, np.arange(m, dtype=np.int32)),)
    records = Records("orientation_prior", touches, evaluate, whitener, np.ones(m, dtype=bool), linear=True)
    return Observed(records, np.full(m, -1), named(names), "", components=LATENT_LABELS)


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
    if len(in_a) < FEWEST_COMMON_OF_MODELS:
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
