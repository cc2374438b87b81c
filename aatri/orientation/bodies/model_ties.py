"""Independent models as bodies: points and perspective centres of each model go to the ground by one similarity.

    x_o = T_m + s_m R_m (x + J_x e_m),     e_m ~ N(0, I)

x are coordinates in the model, base 1: its points, and its two perspective centres (0 and b). The seven unknowns are
those of `similarity_ties`. e_m, five latent unknowns, is the error of the model's relative orientation in units of its
standard deviations: C = W W' its covariance, J_x = (dx / d(d, t)) W. Points and centres of a model share it, so that
its bend is neither taken for gross errors nor counted as independent errors of the points. Along the left ray a point
moves with the orientation as `strips.model_errors` has it; the left centre stays, the right one moves by T t.

Without latent unknowns the centres have a standard deviation of their own, the classical form.

Source: Ackermann, Ebner & Klein 1970 (independent models); docs/formulas.md 4.5; lecture notes A801-A805, erratum E15.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State, Unknowns
from aatri.arrays import Float, Int, Text
from aatri.geometry.similarity import motions
from aatri.observations.observed import Observed, named
from aatri.observations.poses import POINT
from aatri.observations.ties import BODY, Ties
from aatri.orientation.bodies.similarity_ties import LABELS, Similarities, moved, turned_spectrum

LATENT = 5
LATENT_LABELS = tuple(f"error of the relative orientation {k + 1}" for k in range(LATENT))

PLAN = np.array([1, 1, 0, 0, 0, 1, 1] + [0] * LATENT, dtype=bool)
HEIGHT = np.array([0, 0, 1, 1, 1, 0, 0] + [1] * LATENT, dtype=bool)
"""Unknowns of the plan step (shift, rotation about Z, scale) and of the height step, in order of a model's block."""


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
