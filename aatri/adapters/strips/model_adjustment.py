"""Block adjustment with independent models: Models and initial orientations to bodies, these to a Solution."""

from typing import Literal

import numpy as np
from pydantic import Field

from aatri.adapters.strips import oriented_strips as pieces
from aatri.adapters.strips import tied_tables as tables
from aatri.adapters.strips.model_bodies import bodies_of
from aatri.adapters.strips.strip_adjustment import rays_of_ties, resected_on
from aatri.adjustment.statistics.global_test import pooled_test, sigma0_note
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.artifacts.solution import Solution
from aatri.ids import several
from aatri.notes import Note
from aatri.observations.control import KIND as CONTROL
from aatri.observations.poses import POINT
from aatri.observations.positions import KIND as POSITION
from aatri.observations.ties import BODY, MODEL_TIE
from aatri.options import Options
from aatri.orientation.bodies.deformation import Misfit, farthest_bodies, rms_m, search_notes
from aatri.orientation.bodies.independent_models import adjust_models


class ModelAdjustmentOptions(Options):
    """Options of an adjustment of models."""

    iteration: Literal["together", "plan_height"] = Field(
        "together", description="all seven parameters together, or plan (4) and height (3) in turn"
    )
    limit: float | None = Field(
        None, gt=0, description="test statistic of a wrong tie or control point, in sigma; null: by the number of tests"
    )
    max_sigma0: float | None = Field(
        None, gt=0, description="an error where sigma0 is larger; null: a warning beyond 20"
    )
    reliability: bool = Field(
        False, description="redundancy numbers, test statistics and detectable errors of all observations"
    )

    @property
    def plan_height(self) -> bool:
        """Plan and height are adjusted in turn."""
        return self.iteration == "plan_height"


def adjusted_models(
    block: Block,
    image_points: ImagePoints,
    models: Models,
    initial: Solution,
    options: ModelAdjustmentOptions,
    centre_sigma_m: float | None,
    double: bool,
) -> tuple[Solution, list[Note]]:
    """Adjust the models that `initial` orients, or double ones; `centre_sigma_m` None: from the relative orientations.

    Raises
    ------
    GeometryError
        If `initial` orients no model, or something is not determined.
    ConvergenceError
        If the result does not fit.
    """
    bodies, notes = bodies_of(block, models, initial, centre_sigma_m, double=double)
    problem, names = bodies.problem(block), bodies.names
    before = {MODEL_TIE: models.suspects, CONTROL: initial.suspects, POSITION: initial.suspects}
    began = tables.not_rejected(problem.observed, before)
    tied, rounds = adjust_models(problem, limit=options.limit, active=began, plan_height=options.plan_height)
    fit = pooled_test(np.array([tied.sigma0]), np.array([tied.redundancy]))
    distance_m = pieces.distance_m(initial.images.position_m, initial.points.xyz_m)
    worst = farthest_bodies(tied, np.char.add("model ", names))
    misfit = Misfit(options.max_sigma0, distance_m, oriented=True, farthest=worst)
    notes += misfit.notes(fit.sigma0, 1.0, rms_m(tied.residuals, tied.active), "independent models", "")
    per_model = np.bincount(bodies.points.model, minlength=len(names))
    what, centres = ("double model", "three") if double else ("model", "two")
    counts = (
        f"{several(len(names), what)} of {per_model.min()} to {per_model.max()} points (mean {per_model.mean():.1f})"
    )
    text = (
        f"{counts} and {centres} perspective centres; deformation beyond their standard deviations {tied.tau_m:.3f} m"
    )
    notes += [Note("note", text), sigma0_note(fit, f"of {several(len(names), 'independent model')}")]
    if rounds:
        notes.append(Note("note", f"plan and height in turn: {several(rounds, 'round')}"))
    notes += search_notes(tied, tables.names_of, "independent models")
    point_m, similarity = tied.xyz_m + bodies.origin, tied.state[BODY].similarity
    out = np.flatnonzero(~tied.active[: len(bodies.points.model)])
    rejected = bodies.points.model[out], bodies.points.block[out]
    wrong = rays_of_ties(image_points, bodies.centres.model, bodies.centres.block, *rejected)
    position, rotation, resected = resected_on(block, image_points, initial, point_m, wrong)
    transformations = [pieces.similarity_rows(str(name), similarity[k], bodies.origin) for k, name in enumerate(names)]
    covariance_m2 = np.where(np.isfinite(point_m)[:, :, None], tied.covariances[POINT], np.nan)
    solution = tables.solution_of_bodies(
        block,
        image_points,
        pieces.Placed(position, rotation, point_m),
        tied,
        method="model_adjustment/independent_models",
        names=names,
        began=began,
        initial=initial,
        unseen=models.uncontrolled,
        transformations=transformations,
        point_covariance_m2=covariance_m2,
        rounds=rounds,
        tests=options.reliability,
    )
    return solution, [*notes, *resected]
