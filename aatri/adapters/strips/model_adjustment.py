"""Block adjustment with independent models: models to bodies, and adjusted bodies to a Solution.

Models are those of a relative orientation, brought to the ground by an initial orientation, or given by coordinates,
without images: then their perspective centres are points with a standard deviation of their own, and from where the
models lie on the ground about (`models_on_ground`) all are adjusted together. One model is an absolute orientation.
"""

from typing import Literal

import numpy as np
from pydantic import Field

from aatri.adapters.strips import oriented_strips as pieces
from aatri.adapters.strips import tied_tables as tables
from aatri.adapters.strips.model_bodies import bodies_of
from aatri.adapters.strips.strip_adjustment import rays_of_ties, resected_on
from aatri.adjusting.tied_adjustment import TiedResult
from aatri.adjusting.tied_problem import not_rejected, tied_problem
from aatri.adjustment.statistics.global_test import pooled_test, sigma0_note
from aatri.arrays import Float, Text
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.artifacts.solution import Solution
from aatri.errors import GeometryError
from aatri.geometry.rotations import angle_covariance, skew
from aatri.geometry.similarity import Similarity, compose
from aatri.ids import several
from aatri.notes import Note
from aatri.observations.control import KIND as CONTROL
from aatri.observations.control import control_of, observed_control, origin_of
from aatri.observations.poses import POINT
from aatri.observations.positions import KIND as POSITION
from aatri.observations.positions import positions_of
from aatri.observations.ties import BODY, MODEL_TIE
from aatri.options import LimitOfTies, Options, Reliability
from aatri.orientation.bodies.component_growth import BodyPoints
from aatri.orientation.bodies.deformation import Misfit, distance_m, farthest_bodies, rms_m, search_notes
from aatri.orientation.bodies.independent_models import adjust_models
from aatri.orientation.bodies.model_ties import LATENT, ModelPoses, ModelRows, model_ties
from aatri.orientation.bodies.models_on_ground import models_on_ground
from aatri.orientation.bodies.similarity_ties import similarities_of


class ModelAdjustmentOptions(Options):
    """Options of an adjustment of models."""

    iteration: Literal["together", "plan_height"] = Field(
        "together", description="all seven parameters together, or plan (4) and height (3) in turn"
    )
    limit: LimitOfTies = None
    max_sigma0: float | None = Field(
        None, gt=0, description="an error where sigma0 is larger; null: a warning beyond 20"
    )
    reliability: Reliability = False

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
    began = not_rejected(problem.observed, before)
    tied, rounds = adjust_models(problem, limit=options.limit, active=began, plan_height=options.plan_height)
    fit = pooled_test(np.array([tied.sigma0]), np.array([tied.redundancy]))
    away_m = distance_m(initial.images.position_m, initial.points.xyz_m)
    worst = farthest_bodies(tied, np.char.add("model ", names))
    misfit = Misfit(options.max_sigma0, away_m, oriented=True, farthest=worst)
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
    notes += search_notes(tied, "independent models")
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


def adjusted_given_models(
    block: Block, options: ModelAdjustmentOptions, *, exchanged: bool = True
) -> tuple[Solution, list[Note]]:
    """Adjust the models that a block gives by coordinates.

    Parameters
    ----------
    exchanged : bool
        Control points with each other's number are searched for where a model does not fit its control.

    Raises
    ------
    GeometryError
        If no model can be brought to the ground; the message names what is missing.
    ConvergenceError
        If the adjustment does not converge.
    """
    coordinates, control = block.model_coordinates, control_of(block)
    if coordinates is None or not len(coordinates):
        raise GeometryError("the block has no model coordinates", remedy="read them with block/models")
    names, model = np.unique(coordinates.model, return_inverse=True)
    centre = np.stack([coordinates.xyz[model == k].mean(axis=0) for k in range(len(names))])
    x, variance = coordinates.xyz - centre[model], coordinates.sigma**2
    covariance = variance[:, None, None] * np.eye(3)
    body_points = BodyPoints(model.astype(np.int64), coordinates.point.astype(np.int64), x, covariance)
    origin = origin_of(control, positions_of(block).position_m)
    start, notes = models_on_ground(block.points.id, control, body_points, names, origin, exchanged=exchanged)
    chosen = np.flatnonzero([s is not None for s in start])
    place = np.full(len(names), -1)
    place[chosen] = np.arange(len(chosen))
    begin = ModelPoses(similarities_of([s for s in start if s is not None]), np.zeros((len(chosen), LATENT)))
    rows, ids = np.flatnonzero(place[model] >= 0), block.points.id
    point, n = coordinates.point[rows], len(rows)
    tied_rows = ModelRows(place[model[rows]], point, x[rows], covariance[rows], np.zeros((n, 3, LATENT)))
    ties = model_ties(tied_rows, names=names[chosen], latent=False)
    ground = observed_control(control, origin, ids[control.point])
    ground = tuple(o.take(np.flatnonzero(np.isin(o.records.touches[0][1], point))) for o in ground)
    observed = [ties.observed(MODEL_TIE, names[model[rows]], ids[point], begin), *ground]
    places = {POINT: ties.places(begin, len(ids))}
    problem = tied_problem(observed, places, {POINT: ids}, "models given by coordinates")
    began = np.ones(sum(map(len, problem.observed)), dtype=bool)
    tied, rounds = adjust_models(problem, limit=options.limit, active=began, plan_height=options.plan_height)
    fit = pooled_test(np.array([tied.sigma0]), np.array([tied.redundancy]))
    size = [np.ptp(begin.similarity.scale[k] * x[place[model] == k], axis=0) for k in range(len(chosen))]
    misfit = Misfit(options.max_sigma0, float(np.median(np.linalg.norm(size, axis=1))))
    notes += misfit.notes(fit.sigma0, 1.0, rms_m(tied.residuals, tied.active), "models", "")
    text = f"{several(len(chosen), 'model')}; they disagree by {tied.tau_m:.3g} m beyond their standard deviations"
    notes += [
        Note("note", text),
        sigma0_note(fit, f"of {several(len(chosen), 'model')}"),
        *search_notes(tied, "models"),
    ]
    if rounds:
        notes.append(Note("note", f"plan and height in turn: {several(rounds, 'round')}"))
    return _solution(block, tied, names[chosen], centre[chosen], origin, rounds, options.reliability), notes


def _solution(
    block: Block, tied: TiedResult, names: Text, centre: Float, origin: Float, rounds: int, tests: bool
) -> Solution:
    began = np.ones(sum(map(len, tied.problem.observed)), dtype=bool)
    similarity = tied.state[BODY].similarity
    point_m = tied.xyz_m + origin
    transformations = []
    for k, name in enumerate(names.tolist()):
        to = compose(similarity[k], Similarity(-centre[k], 1.0, np.eye(3)))
        sigma = _sigmas(to, centre[k], tied.covariances[BODY][k][:7, :7])
        transformations.append(pieces.similarity_rows(name, to, origin, sigma))
    none = np.full((len(block.images), 3), np.nan)
    return tables.solution_of_bodies(
        block,
        None,
        pieces.Placed(none, np.full((len(none), 3, 3), np.nan), point_m),
        tied,
        method="model_adjustment/given_models",
        names=names,
        began=began,
        transformations=transformations,
        point_covariance_m2=np.where(np.isfinite(point_m)[:, :, None], tied.covariances[POINT], np.nan),
        rounds=rounds,
        tests=tests,
    )


def _sigmas(to: Similarity, centre: Float, covariance: Float) -> Float:
    """Standard deviations of shift, scale, omega, phi and kappa from the covariance of the step about the centre.

    dT0 = dT + [s R c]x d - s R c m,      ds = s m
    """
    arm = to.scale * to.rotation @ centre
    J = np.eye(7)
    J[:3, 3:6], J[:3, 6] = skew(arm[None])[0], -arm
    J[6, 6] = to.scale
    C = J @ covariance @ J.T
    angles = angle_covariance(to.rotation[None], C[None, 3:6, 3:6], "omega-phi-kappa")[0]
    return np.asarray(np.sqrt(np.concatenate([np.diagonal(C)[:3], C[6:, 6], np.diagonal(angles)])))
