"""Block adjustment with independent models: Models and initial orientations to bodies, these to a Solution."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from aatri.adapters import solution as assemble
from aatri.adapters.strips import strips as pieces
from aatri.adapters.strips.model_bodies import Bodies, GivenRows, bodies_of
from aatri.adapters.strips.strip_adjustment import resected_on
from aatri.adapters.uncontrolled_before import NOT_SEEN, not_seen_since, notes_of, of_observations
from aatri.adjustment.statistics.global_test import pooled_test, sigma0_note
from aatri.arrays import Bool, Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.artifacts.solution import Residuals, Solution, StripTransformations
from aatri.artifacts.suspects import Suspects
from aatri.artifacts.uncontrolled import Uncontrolled
from aatri.geometry.vectors import finite_rows
from aatri.notes import Note
from aatri.orientation.free_block.deformation import Misfit, rms_m, search_notes
from aatri.orientation.free_block.independent_models import AdjustedModels, adjust_models

STAGE = "model_adjustment"


@dataclass(frozen=True)
class ModelRules:
    """How models are adjusted; see the options of the stage. `centre_sigma_m` None: from the relative orientations."""

    centre_sigma_m: float | None
    plan_height: bool
    limit: float
    max_sigma0: float | None


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
    bodies, notes = bodies_of(block, models, initial, rules.centre_sigma_m)
    names = models.orientations.id[bodies.model]
    rows, given = bodies.rows, bodies.given
    n, n_ground = len(rows.point), len(block.points)
    model_names, points = names[rows.model], _point_names(block, rows.point)
    began = ~np.concatenate([
        pieces.rejected_before(models.suspects, "model_tie", model_names, points),
        *(pieces.rejected_rows(initial.suspects, g.points.kind, g.row) for g in given),
    ])  # fmt: skip
    began[bodies.n_model_points : n] = True
    found = adjust_models(
        rows, n_ground + len(block.images), [g.points for g in given], bodies.start, names=names,
        latent=rules.centre_sigma_m is None, limit=rules.limit, plan_height=rules.plan_height, active=began,
    )  # fmt: skip
    tied = found.tied

    def called(chosen: Int) -> list[str]:
        ties, of_given = chosen[chosen < n], chosen[chosen >= n] - n
        told = [f"point {p} in model {m}" for p, m in zip(points[ties], model_names[ties])]
        every = [
            f"position of image {i}" if i else f"control point {p}" for g in given for i, p in zip(g.image, g.point)
        ]
        return told + [every[k] for k in of_given.tolist()]

    fit = pooled_test(np.array([tied.sigma0]), np.array([tied.observations - tied.unknowns]))
    misfit = Misfit(rules.max_sigma0, pieces.distance_m(initial.images.position_m, initial.points.xyz_m))
    notes += misfit.notes(fit.sigma0, 1.0, rms_m(tied.residual_m, tied.active), "independent models", "")
    per_model = np.bincount(rows.model[: bodies.n_model_points], minlength=len(names))
    counts = f"{len(names)} models of {per_model.min()} to {per_model.max()} points (mean {per_model.mean():.1f})"
    text = f"{counts} and two perspective centres; deformation beyond their standard deviations {tied.tau_m:.3f} m"
    notes += [Note("note", text), sigma0_note(fit, f"of {len(names)} independent models")]
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
        residuals=_residuals(bodies, found, model_names, points),
        suspects=_suspects(models, initial, bodies, found, began, model_names, points),
        point_covariance_m2=tied.point_covariance_m2[:n_ground], uncontrolled=uncontrolled,
    )  # fmt: skip
    return solution, [*notes, *resected]


def _point_names(block: Block, point: Int) -> Text:
    """Ids of ground points, and of images for their perspective centres."""
    return np.concatenate([block.points.id, block.images.id])[point]


def _transformations(found: AdjustedModels, bodies: Bodies, names: Text) -> StripTransformations:
    of = found.tied.state.similarity
    tables = [pieces.similarity_rows(str(name), of[k], bodies.origin) for k, name in enumerate(names)]
    return assemble.stacked([StripTransformations.empty(), *tables])


def _residuals(bodies: Bodies, found: AdjustedModels, model: Text, point: Text) -> Residuals:
    """Of control: adjusted minus given; of models: adjusted minus the single model."""
    tied, n = found.tied, len(bodies.rows.point)
    shared = np.bincount(bodies.rows.point)[bodies.rows.point] > 1
    centre = np.arange(n) >= bodies.n_model_points
    sigma = bodies.start.similarity.scale[bodies.rows.model][:, None] * np.sqrt(
        np.einsum("nii->ni", bodies.rows.covariance)
    )

    def of_ties(kind: str, rows: Int) -> Residuals:
        return assemble.residuals(
            kind, np.full(len(rows), -1), model[rows], point[rows], tied.residual_m[rows], sigma[rows],
            tied.active[rows],
        )  # fmt: skip

    def of_given(g: GivenRows, first: int) -> Residuals:
        known = np.flatnonzero(finite_rows(tied.point_m[g.points.point]))
        sigmas = np.where(g.points.given, np.sqrt(np.einsum("nii->ni", g.points.covariance_m2)), np.nan)
        return assemble.residuals(
            g.points.kind, g.row[known], g.image[known], g.point[known], tied.residual_m[first + known], sigmas[known],
            tied.active[first + known],
        )  # fmt: skip

    return assemble.stacked([
        *(of_given(g, first) for g, first in _with_first(bodies)),
        of_ties("model_tie", np.flatnonzero(shared & ~centre)),
        of_ties("perspective_centre", np.flatnonzero(shared & centre)),
    ])  # fmt: skip


def _with_first(bodies: Bodies) -> Iterator[tuple[GivenRows, int]]:
    """What is given, kind by kind, and the first of its observations."""
    first = len(bodies.rows.point)
    for g in bodies.given:
        yield g, first
        first += len(g.row)


def _uncontrolled(
    block: Block, models: Models, bodies: Bodies, found: AdjustedModels, model: Text, point: Text
) -> Uncontrolled:
    """Image points that no second model and no control has seen; ties and control that the others do not control."""
    tied, given, n, n_points = found.tied, bodies.given, len(bodies.rows.point), len(block.points)
    own = bodies.rows.point[: bodies.n_model_points][tied.active[: bodies.n_model_points]]
    held = np.bincount(own, minlength=n_points) > 1
    for g, first in _with_first(bodies):
        known = g.points.point[tied.active[first : first + len(g.row)]]
        held[known[known < n_points]] = True
    kinds = ["model_tie", "perspective_centre", *(g.points.kind for g in given)]
    counts = [bodies.n_model_points, n - bodies.n_model_points, *(len(g.row) for g in given)]
    return assemble.stacked([
        not_seen_since(models.uncontrolled, block, held),
        of_observations(
            tied.uncontrolled, np.repeat(kinds, counts), np.concatenate([np.full(n, -1), *(g.row for g in given)]),
            np.concatenate([model, *(g.image for g in given)]), np.concatenate([point, *(g.point for g in given)]),
        ),
    ])  # fmt: skip


def _suspects(
    models: Models, initial: Solution, bodies: Bodies, found: AdjustedModels, began: Bool,
    model: Text, point: Text,
) -> Suspects:  # fmt: skip
    """Suspects of earlier stages, with ties of models and control tested here anew."""
    tied, n = found.tied, len(bodies.rows.point)
    before = initial.suspects
    again = (before.kind == "model_tie") & np.isin(before.image, models.orientations.id[bodies.model])
    for g in bodies.given:
        again |= (before.kind == g.points.kind) & np.isin(before.row, g.row)
    of_points = np.arange(n) < bodies.n_model_points

    def tested(kind: str, k: Int, row: Int, image: Text, point: Text) -> Suspects:
        return pieces.tested(kind=kind, row=row, image=image, point=point, stage=STAGE, size_m=tied.size_m[k],
                             test=tied.test[k], began=began[k], active=tied.active[k], above=tied.above[k])  # fmt: skip

    kinds = (("model_tie", np.flatnonzero(of_points)), ("perspective_centre", np.flatnonzero(~of_points)))
    return assemble.stacked([
        before.take(~again),
        *(tested(kind, k, np.full(len(k), -1), model[k], point[k]) for kind, k in kinds),
        *(tested(g.points.kind, first + np.arange(len(g.row)), g.row, g.image, g.point)
          for g, first in _with_first(bodies)),
    ])  # fmt: skip
