"""Block adjustment with independent models: Models and initial orientations to bodies, these to a Solution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.adapters import solution as assemble
from aatri.adapters.strips import strips as pieces
from aatri.adapters.strips.strip_adjustment import resected_on
from aatri.adapters.uncontrolled_before import NOT_SEEN, not_seen_since, notes_of, of_observations
from aatri.adjustment.statistics.global_test import pooled_test, refuse_misfit, sigma0_note
from aatri.arrays import Bool, Float, Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.artifacts.solution import Residuals, Solution, StripTransformations
from aatri.artifacts.suspects import Suspects
from aatri.artifacts.uncontrolled import Uncontrolled
from aatri.errors import GeometryError
from aatri.geometry.vectors import finite_rows, tangents
from aatri.notes import Note
from aatri.observations.control import Control, control_of
from aatri.observations.positions import positions_of
from aatri.orientation.free_block.deformation import search_notes
from aatri.orientation.free_block.independent_models import AdjustedModels, adjust_models
from aatri.orientation.free_block.model_ties import LATENT, ModelPoses, ModelRows
from aatri.orientation.free_block.similarity_ties import Similarities
from aatri.orientation.free_block.tie_records import EXACT, GivenPoints
from aatri.orientation.strips.log_scale import root_of
from aatri.orientation.strips.model_errors import point_errors

STAGE = "model_adjustment"


@dataclass(frozen=True)
class ModelRules:
    """How models are adjusted; see the options of the stage. `centre_sigma_m` None: from the relative orientations."""

    centre_sigma_m: float | None
    plan_height: bool
    limit: float
    max_sigma0: float


@dataclass(frozen=True)
class _Bodies:
    """Oriented models with their rows; `model` are rows in the orientations of Models."""

    model: Int
    rows: ModelRows
    n_model_points: int
    start: ModelPoses
    origin: Float
    control: Control


def adjusted_models(
    block: Block, image_points: ImagePoints, models: Models, initial: Solution, rules: ModelRules
) -> tuple[Solution, list[Note]]:
    """Adjust the models that `initial` orients.

    Raises
    ------
    GeometryError
        If `initial` orients no model, or something is not determined.
    ConvergenceError
        If the result does not fit.
    """
    bodies = _bodies(block, models, initial, rules)
    names = models.orientations.id[bodies.model]
    rows, control = bodies.rows, bodies.control
    n, n_ground = len(rows.point), len(block.points)
    model_names, points = names[rows.model], _point_names(block, rows.point)
    began = ~np.concatenate([
        pieces.rejected_before(models.suspects, "model_tie", model_names, points),
        pieces.rejected_rows(initial.suspects, "control", control.row),
    ])  # fmt: skip
    began[bodies.n_model_points : n] = True
    given = GivenPoints("control", control.point, control.xyz_m - bodies.origin, control.covariance_m2, control.given)
    found = adjust_models(
        rows, n_ground + len(block.images), [given], bodies.start, names=names, latent=rules.centre_sigma_m is None,
        limit=rules.limit, plan_height=rules.plan_height, active=began,
    )  # fmt: skip
    tied = found.tied

    def called(chosen: Int) -> list[str]:
        ties, of_control = chosen[chosen < n], chosen[chosen >= n] - n
        told = [f"point {p} in model {m}" for p, m in zip(points[ties], model_names[ties])]
        return told + [f"control point {p}" for p in block.points.id[control.point[of_control]]]

    fit = pooled_test(np.array([tied.sigma0]), np.array([tied.observations - tied.unknowns]))
    refuse_misfit(fit, rules.max_sigma0, "of the independent models")
    per_model = np.bincount(rows.model[: bodies.n_model_points], minlength=len(names))
    counts = f"{len(names)} models of {per_model.min()} to {per_model.max()} points (mean {per_model.mean():.1f})"
    text = f"{counts} and two perspective centres; deformation beyond their standard deviations {tied.tau_m:.3f} m"
    notes = [Note("note", text), sigma0_note(fit, f"of {len(names)} independent models")]
    if found.rounds:
        notes.append(Note("note", f"plan and height in turn: {found.rounds} rounds"))
    notes += search_notes(tied, called, "independent models")
    uncontrolled = _uncontrolled(block, models, bodies, found, model_names, points)
    notes += notes_of(uncontrolled, NOT_SEEN)
    point_m = tied.point_m[:n_ground] + bodies.origin
    position, rotation, resected = resected_on(block, image_points, initial, point_m)
    assert tied.point_covariance_m2 is not None  # asked for by adjust_models
    solution = pieces.solution_of(
        block, image_points, pieces.Placed(position, rotation, point_m),
        method="model_adjustment/independent_models", counts=(tied.observations, tied.unknowns), sigma0=tied.sigma0,
        iterations=tied.iterations + found.rounds, transformations=_transformations(found, bodies, names),
        parameters=pieces.precision_row("all models", tied.tau_m),
        residuals=_residuals(block, bodies, found, model_names, points),
        suspects=_suspects(block, models, initial, bodies, found, began, model_names, points),
        point_covariance_m2=tied.point_covariance_m2[:n_ground], uncontrolled=uncontrolled,
    )  # fmt: skip
    return solution, [*notes, *resected]


def _bodies(block: Block, models: Models, initial: Solution, rules: ModelRules) -> _Bodies:
    o, p = models.orientations, models.model_points
    images = initial.images
    oriented = np.flatnonzero(images.oriented[o.left] & images.oriented[o.right])
    if not len(oriented):
        raise GeometryError("`initial` orients no model", remedy="check `from`: initial wants the absolute orientation")
    control = control_of(block)
    origin = pieces.origin_of(control, positions_of(block))
    left, right = o.left[oriented], o.right[oriented]
    scale = np.linalg.norm(images.position_m[right] - images.position_m[left], axis=1)
    similarity = Similarities(images.position_m[left] - origin, scale, images.ground_from_image[left].copy())
    start = ModelPoses(similarity, np.zeros((len(oriented), LATENT)))
    place = np.full(len(o), -1)
    place[oriented] = np.arange(len(oriented))
    rows = np.flatnonzero(p.active & (place[p.model] >= 0))
    model, m = place[p.model[rows]], len(oriented)
    root = root_of(o.covariance[oriented])
    latent = rules.centre_sigma_m is None
    of_points = (
        point_errors(p.xyz[rows], o.base[oriented][model], root[model]) if latent else np.zeros((len(rows), 3, 5))
    )
    centres = np.concatenate([np.zeros((m, 3)), o.base[oriented]])
    of_centres = np.zeros((2 * m, 3, 5))
    if rules.centre_sigma_m is None:
        T = np.array([tangents(b) for b in o.base[oriented]])
        of_centres[m:] = T @ root[:, 3:]
        typical = float(np.median(np.einsum("nii->n", p.covariance[rows]))) / 3 if len(rows) else 1.0
        variance = np.full(2 * m, EXACT**2 * typical)
    else:
        variance = np.tile((rules.centre_sigma_m / scale) ** 2, 2)
    every = ModelRows(
        np.concatenate([model, np.tile(np.arange(m), 2)]),
        np.concatenate([p.point[rows].astype(np.int64), len(block.points) + np.concatenate([left, right])]),
        np.concatenate([p.xyz[rows], centres]),
        np.concatenate([p.covariance[rows], variance[:, None, None] * np.eye(3)]),
        np.concatenate([of_points, of_centres]),
    )
    return _Bodies(oriented, every, len(rows), start, origin, control)


def _point_names(block: Block, point: Int) -> Text:
    """Ids of ground points, and of images for their perspective centres."""
    return np.concatenate([block.points.id, block.images.id])[point]


def _transformations(found: AdjustedModels, bodies: _Bodies, names: Text) -> StripTransformations:
    of = found.tied.state.similarity
    tables = [pieces.similarity_rows(str(name), of[k], bodies.origin) for k, name in enumerate(names)]
    return assemble.stacked([StripTransformations.empty(), *tables])


def _residuals(block: Block, bodies: _Bodies, found: AdjustedModels, model: Text, point: Text) -> Residuals:
    """Of control: adjusted minus given; of models: adjusted minus the single model."""
    tied, control, n = found.tied, bodies.control, len(bodies.rows.point)
    shared = np.bincount(bodies.rows.point)[bodies.rows.point] > 1
    centre = np.arange(n) >= bodies.n_model_points
    sigma = bodies.start.similarity.scale[bodies.rows.model][:, None] * np.sqrt(
        np.einsum("nii->ni", bodies.rows.covariance)
    )
    known = np.flatnonzero(finite_rows(tied.point_m[control.point]))

    def of(kind: str, rows: Int) -> Residuals:
        return assemble.residuals(
            kind, np.full(len(rows), -1), model[rows], point[rows], tied.residual_m[rows], sigma[rows],
            tied.active[rows],
        )  # fmt: skip

    return assemble.stacked([
        assemble.residuals(
            "control", control.row[known], np.full(len(known), ""), block.points.id[control.point[known]],
            tied.residual_m[n:][known],
            np.where(control.given, np.sqrt(np.einsum("nii->ni", control.covariance_m2)), np.nan)[known],
            tied.active[n:][known],
        ),
        of("model_tie", np.flatnonzero(shared & ~centre)),
        of("perspective_centre", np.flatnonzero(shared & centre)),
    ])  # fmt: skip


def _uncontrolled(
    block: Block, models: Models, bodies: _Bodies, found: AdjustedModels, model: Text, point: Text
) -> Uncontrolled:
    """Image points that no second model and no control has seen; ties and control that the others do not control."""
    tied, control, n, n_points = found.tied, bodies.control, len(bodies.rows.point), len(block.points)
    own = bodies.rows.point[: bodies.n_model_points][tied.active[: bodies.n_model_points]]
    held = np.bincount(own, minlength=n_points) > 1
    held[control.point[tied.active[n:]]] = True
    counts = [bodies.n_model_points, n - bodies.n_model_points, len(control.row)]
    return assemble.stacked([
        not_seen_since(models.uncontrolled, block, held),
        of_observations(
            tied.uncontrolled, np.repeat(["model_tie", "perspective_centre", "control"], counts),
            np.concatenate([np.full(n, -1), control.row]), np.concatenate([model, np.full(len(control.row), "")]),
            np.concatenate([point, block.points.id[control.point]]),
        ),
    ])  # fmt: skip


def _suspects(
    block: Block, models: Models, initial: Solution, bodies: _Bodies, found: AdjustedModels, began: Bool,
    model: Text, point: Text,
) -> Suspects:  # fmt: skip
    """Suspects of earlier stages, with ties of models and control tested here anew."""
    tied, control, n = found.tied, bodies.control, len(bodies.rows.point)
    before = initial.suspects
    again = (before.kind == "model_tie") & np.isin(before.image, models.orientations.id[bodies.model])
    again |= (before.kind == "control") & np.isin(before.row, control.row)
    of_points = np.arange(n) < bodies.n_model_points

    def tested(kind: str, rows: Bool) -> Suspects:
        k = np.flatnonzero(rows)
        return pieces.tested(kind=kind, row=np.full(len(k), -1), image=model[k], point=point[k], stage=STAGE,
                             size_m=tied.size_m[k], test=tied.test[k], began=began[k], active=tied.active[k],
                             above=tied.above[k])  # fmt: skip

    return assemble.stacked([
        before.take(~again),
        tested("model_tie", of_points),
        tested("perspective_centre", ~of_points),
        pieces.tested(kind="control", row=control.row, image=np.full(len(control.row), ""),
                      point=block.points.id[control.point], stage=STAGE, size_m=tied.size_m[n:], test=tied.test[n:],
                      began=began[n:], active=tied.active[n:], above=tied.above[n:]),
    ])  # fmt: skip
