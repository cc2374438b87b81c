"""Observations of tied bodies - strips, models, components - as tables of a Solution: every kind in the same way."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from aatri.adapters.observation_tables import (
    not_seen_since,
    reliability_table,
    residual_table,
    suspect_table,
    uncontrolled_table,
    variance_table,
)
from aatri.adapters.solution import stacked
from aatri.adapters.strips import oriented_strips as pieces
from aatri.adjusting.adjusted_observations import AdjustedObservations, classes_of, sigmas_of_groups
from aatri.adjusting.tied_adjustment import TiedResult
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.residuals import Residuals, Tests
from aatri.artifacts.solution import Solution, StripTransformations, VarianceComponents
from aatri.artifacts.suspects import Suspects, Uncontrolled
from aatri.geometry.similarity import Similarity
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT
from aatri.observations.ties import BODY, COMPONENT_CENTRE, COMPONENT_POINT


def _native(result: TiedResult) -> Iterator[tuple[Observed, slice]]:
    """Kinds of observation that are the block's, and where they are among all: not what a free body is held by."""
    for o, first in zip(result.problem.observed, result.problem.edges):
        if o.kind not in (COMPONENT_POINT, COMPONENT_CENTRE):
            yield o, slice(first, first + len(o))


def residuals_of(result: TiedResult, state: State | None = None) -> Residuals:
    """Residuals of what is observed of the ground, then of ties of several bodies.

    Parameters
    ----------
    state : mapping, optional
        Other values of the unknowns, such as points that are held against control.
    """
    values = result.state if state is None else state
    return stacked([Residuals.empty(), *(residual_table(adjusted, values) for adjusted in _shown(result))])


def tests_of(result: TiedResult) -> Tests:
    """Redundancy numbers, tests and detectable errors of the observations in the order of `residuals_of`."""
    return stacked([Tests.empty(), *(reliability_table(adjusted, result.state) for adjusted in _shown(result))])


def components_of(result: TiedResult) -> VarianceComponents:
    """Factors on the standard deviations of each kind, plan and height apart where they are, the deformation counted.

    As the residuals of this adjustment have them: they are proposed, and not iterated.
    """
    names, shown, numbers = list[str](), list(_shown(result)), list[Int]()
    for o in (adjusted.observed for adjusted in shown):
        classes, number = classes_of(o)
        numbers.append(np.where(o.demanded(), -1, len(names) + number))
        names += classes
    return variance_table(names, sigmas_of_groups(shown, result.state, numbers, len(names)))


def _shown(result: TiedResult) -> Iterator[AdjustedObservations]:
    """What is observed of the ground, then ties of several bodies."""
    native = [o.kind for o, _ in _native(result)]
    for adjusted in sorted(result.observations, key=lambda adjusted: adjusted.observed.spread is not None):
        if adjusted.observed.kind in native:
            yield _of_several(adjusted)


def _of_several(adjusted: AdjustedObservations) -> AdjustedObservations:
    touched = [block for group, block in adjusted.observed.records.touches if group != BODY]
    if adjusted.observed.spread is None or not touched:
        return adjusted
    shared = np.bincount(touched[0])[touched[0]] > 1
    return replace(adjusted, rows=adjusted.rows[shared[adjusted.rows]])


def suspects_of(result: TiedResult, stage: str, began: Bool, to: Similarity | None = None) -> Suspects:
    """What was rejected, was rejected before and is believed again, or is kept although above the limit.

    Parameters
    ----------
    began : (n,) bool
        Observations used before the test.
    to : Similarity, optional
        To the ground, from the frame of the bodies.
    """
    tables = [Suspects.empty()]
    for o, part in _native(result):
        active, above = result.active[part], result.above[part]
        listed = np.flatnonzero(~active | ~began[part] | above)
        error, test = result.size[part][listed], result.test[part][listed]
        error = error if to is None else to.scale * error @ to.rotation.T
        verdict = np.where(active[listed], np.where(above[listed], "kept", "readmitted"), "rejected")
        tables.append(suspect_table(stage, o, listed, error, test, verdict))
    return stacked(tables)


def not_tested(before: Suspects, result: TiedResult, bodies: Text) -> Suspects:
    """Suspects of earlier stages but those tested here anew: ties of some bodies, and what was observed."""
    readmitted = np.zeros(len(before), dtype=bool)
    for o, _ in _native(result):
        part = np.isin(before.row, o.row) if (o.row >= 0).any() else np.isin(before.image, bodies)
        readmitted |= (before.kind == o.kind) & part
    return before.take(~readmitted)


def seen_points(result: TiedResult) -> Bool:
    """Points that several bodies hold, or control, (n_points,)."""
    n = len(result.state[POINT])
    bodies, seen = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=bool)
    for o, part in _native(result):
        touched = [block for group, block in o.records.touches if group == POINT]
        if len(touched) == 1:
            points = touched[0][result.active[part]]
            if o.spread is None:
                seen[points] = True
            else:
                bodies += np.bincount(points, minlength=n)
    return np.asarray(seen | (bodies > 1))


def uncontrolled_kinds(result: TiedResult, turned: Float | None = None) -> Uncontrolled:
    """What the others do not control; `turned`, (3, 3), to the ground from the axes of the bodies."""
    few, least, direction = result.uncontrolled
    along = direction if turned is None else direction @ turned.T
    tables = [Uncontrolled.empty()]
    for o, part in _native(result):
        of_kind = (few >= part.start) & (few < part.stop)
        tables.append(uncontrolled_table(o, few[of_kind] - part.start, least[of_kind], along[of_kind]))
    return stacked(tables)


def solution_of_bodies(
    block: Block,
    image_points: ImagePoints | None,
    placed: pieces.Placed,
    tied: TiedResult,
    *,
    method: str,
    names: Text,
    began: Bool,
    transformations: Sequence[StripTransformations],
    point_covariance_m2: Float,
    initial: Solution | None = None,
    unseen: Uncontrolled | None = None,
    at: State | None = None,
    rounds: int = 0,
    tests: bool = False,
) -> Solution:
    """The Solution of adjusted strips or models: its tables are those of every kind of body.

    Parameters
    ----------
    placed : Placed
        Images and points on the ground.
    method : str
        ROLE/VARIANT.
    names : (n,) str
        Of the bodies.
    began : (n,) bool
        Observations that no earlier stage has rejected.
    initial : Solution, optional
    unseen : Uncontrolled, optional
        What the stage before has listed.
    at : State, optional
        Values from which the residuals are told; default: those of the adjustment.
    rounds : int
        Iterations before those of `tied`.
    tests : bool
        Redundancy numbers, tests and variance components too.
    """
    role, before = method.split("/")[0], Suspects.empty() if initial is None else initial.suspects
    return pieces.solution_of(
        block,
        image_points,
        placed,
        method=method,
        counts=tied.counts,
        sigma0=tied.sigma0,
        iterations=tied.iterations + rounds,
        transformations=stacked([StripTransformations.empty(), *transformations]),
        parameters=pieces.precision_row("all strips" if role == "strip_adjustment" else "all models", tied.tau_m),
        residuals=residuals_of(tied, at),
        suspects=stacked([not_tested(before, tied, names), suspects_of(tied, role, began)]),
        point_covariance_m2=point_covariance_m2,
        uncontrolled=stacked([not_seen_since(unseen, block, seen_points(tied)), uncontrolled_kinds(tied)]),
        tests=tests_of(tied) if tests else None,
        components=components_of(tied) if tests else None,
    )
