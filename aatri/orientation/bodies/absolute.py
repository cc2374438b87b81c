"""Absolute orientation: one similarity from a free body to the ground, from all that is observed of it together.

    X = T + s R x + v,      X0 = T + s R x0 + v,      R_image = exp([v]x) R R_k

with x the body's points, x0 its projection centres and R_k the rotations of its images: they are tied to the body
(`free_body`), and control, positions, attitudes, distances, azimuths, height differences, shapes ... observe them as
they do in a bundle, each with its standard deviation and its own unknowns. Bodies are deformed; the deformation tau
added to the standard deviation of their points is estimated together with the unknowns, so that control of 2 cm and
positions of 10 cm work together (adjusting.tied_adjustment). What is wrong is found by data snooping.

Start: see `datum_start`. What the observations leave open is found beforehand and named (datum_analysis).
"""

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from aatri.adjusting.tied_adjustment import TiedResult, adjust_tied
from aatri.adjusting.tied_problem import TiedProblem, tied_problem
from aatri.adjustment.statistics.limits import SMALL_ROOM
from aatri.adjustment.statistics.rejection import Snooping
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int, Text
from aatri.errors import ConvergenceError, GeometryError
from aatri.geometry.rotations import levelling
from aatri.geometry.similarity import Similarity, compose, transform
from aatri.ids import shown
from aatri.observations.attitudes import KIND as ATTITUDE
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT, POSE
from aatri.observations.ties import BODY
from aatri.orientation.bodies.agreeing_places import agreeing_places
from aatri.orientation.bodies.datum_analysis import (
    DatumAnalysis,
    GivenPlaces,
    OpenDatumError,
    analyse_datum,
    given_places,
)
from aatri.orientation.bodies.datum_start import (
    Observe,
    centroid_start,
    closed_start,
    fits,
    near_start,
    scaled,
    searched_start,
    two_point_start,
)
from aatri.orientation.bodies.deformation import bends_far_less
from aatri.orientation.bodies.free_body import FreeBody, held_motions, state_of, ties_of
from aatri.orientation.bodies.limits import (
    ALL_SIDES,
    ONE_FAR_IN,
    STIFF_REDUNDANCY,
    STIFF_SIGMA0,
    THINNEST_PLACES,
    UNDETERMINED_MOTION,
)
from aatri.orientation.bodies.wrong_control import exchanged_by_all, exchanged_of, refuse_mirrored
from aatri.orientation.bodies.wrong_tables import refuse_wrong

Start = Literal["closed", "two_points", "centroids"]

NOTHING = "it holds no control point and no observed position"
ENOUGH = "at least two points known in plan and three in height, not on a line, or as many observed positions"
OFF_THE_LINE = "add a point with a known height well off that line, or observed positions of images in another strip"


@dataclass(frozen=True)
class OrientationSettings:
    """How a body is oriented."""

    limit: float
    """Test statistic of what is wrong."""
    start: Start = "closed"
    """From all places known in full (`closed`), from two known in plan (`two_points`), from these by all known in full,
    reduced to their centroid (`centroids`)."""
    weakest: float = UNDETERMINED_MOTION
    """Motions known less well count as not determined; see `datum_analysis`."""
    stiff: bool = False
    """The body comes from an adjustment of all its images: where all else fits without some gross errors, they are told
    from a deformation, which a few wrong points would otherwise be taken for."""
    free: bool = False
    """What is not determined is held where it is."""
    exchanged: bool = True
    """Control points with each other's number are searched for where the start does not fit."""
    rejects: bool = True
    """What does not fit is left out."""


@dataclass(frozen=True)
class OrientedBody:
    """Result of the absolute orientation of a body."""

    ground_from_body: Similarity
    analysis: DatumAnalysis
    """Of what is not rejected."""
    tied: TiedResult
    """The adjustment: the points, centres and rotations of the body, then what is observed, kind by kind."""
    began: Bool
    """(n,). Observations of it that had part at first."""
    state: State
    """Images and points as they lie on the ground, not adjusted; the adjusted unknowns of the kinds."""
    neglects: bool = False
    """Unknowns that kinds have of their own are neglected: what does not fit need not be wrong."""

    @property
    def places(self) -> GivenPlaces:
        """Coordinates that are observed, in the order of the adjustment's observations."""
        return given_places(self.tied.problem.observed, self.state)


def orient_body(
    observe: Observe,
    body: FreeBody,
    settings: OrientationSettings,
    *,
    what: str,
    image_ids: Text,
    point_ids: Text,
    begin: Callable[[Sequence[Observed]], Bool] | None = None,
) -> OrientedBody:
    """Orient one body.

    Parameters
    ----------
    what : str
        The body, for messages.
    image_ids, point_ids : (n,) str
    begin : callable, optional
        Observations -> those to begin with, kind by kind; the others are tested for re-admission.

    Raises
    ------
    OpenDatumError
        If all observations together leave something open; the message names it.
    GeometryError
        If those that are not rejected do. If the images would look upwards.
    """
    level = Similarity(np.zeros(3), 1.0, levelling(body.up))
    observed = observe(level)
    use = np.ones(sum(map(len, observed)), dtype=bool) if begin is None else begin(observed)
    start = _start(observe, observed, use, body, settings, what)
    observed = observe(start)
    analysis = _analysed(observed, use, body, start, settings, what)
    ties, centre = ties_of(body, observed, start, what, image_ids, point_ids)
    fixed = [held_motions(analysis.motions, body, start, centre)] if analysis.open else []
    state, ids = body.on_ground(start), {POINT: point_ids, POSE: image_ids}
    problem = tied_problem([*ties, *observed, *fixed], state, ids, f"absolute orientation of {what}")
    n, first = len(problem.components), problem.n_ties
    began = np.append(np.ones(first, dtype=bool), use[: n - first])
    placed_from = partial(_placed, problem, analysis, body, centre, settings, what)
    near = np.append(np.ones(first, dtype=bool), near_start(observed, body, start, settings.limit)[: n - first])
    far = began & ~near
    try:
        oriented = placed_from(began)
        if 0 < np.count_nonzero(far) <= min(SMALL_ROOM, (n - first) // ONE_FAR_IN) and not settings.free:
            with contextlib.suppress(ConvergenceError, GeometryError):
                other = placed_from(began & near)
                oriented = other if bends_far_less(other.tied, oriented.tied) else oriented
    except (ConvergenceError, GeometryError) as failure:
        try:
            if not far.any():
                raise
            oriented = placed_from(began & near)
        except (ConvergenceError, GeometryError):
            if not settings.free:
                refuse_wrong(given_places(observed, state), use, start, _up(observed, body), what)
            raise failure from None
    if settings.free:
        return oriented
    # What remains must still determine the body: what is rejected does not count.
    use[: n - first] = oriented.tied.active[first:]
    return replace(oriented, analysis=_analysed(observed, use, body, oriented.ground_from_body, settings, what))


def _placed(
    problem: TiedProblem,
    analysis: DatumAnalysis,
    body: FreeBody,
    centre: Float,
    settings: OrientationSettings,
    what: str,
    began: Bool,
) -> OrientedBody:
    """The body adjusted from what takes part at first, (n,) bool; an error where it lies mirrored."""
    tied = _adjusted(problem, began, settings)
    to = compose(tied.state[BODY][0], Similarity(-centre, 1.0, np.eye(3)))
    oriented = OrientedBody(to, analysis, tied, began, {**tied.state, **body.on_ground(to)})
    if not settings.free:
        places = oriented.places
        refuse_mirrored(places, tied.active[places.row], to, _up(problem.ground, body), what)
    return oriented


def _up(observed: Sequence[Observed], body: FreeBody) -> Float | None:
    """Direction against the mean viewing direction; None where there is none, or attitudes say what is upwards."""
    to_all_sides = np.linalg.norm(body.up) <= ALL_SIDES
    return None if to_all_sides or any(o.kind == ATTITUDE for o in observed) else body.up


def _start(
    observe: Observe, observed: Sequence[Observed], use: Bool, body: FreeBody, settings: OrientationSettings, what: str
) -> Similarity:
    """Ground from body, about; control points with each other's number no longer count, they would spoil it."""
    level = Similarity(np.zeros(3), 1.0, levelling(body.up))
    if settings.free:
        return scaled(observed, use, body, level)
    if not any(not o.components for o in observed):
        raise OpenDatumError(f"{what}: not determined, {NOTHING}", remedy=ENOUGH)
    all_places = given_places(observed, state_of(observed, body, level))
    exchanged = all_places.row[exchanged_of(all_places.take(use[all_places.row]), level.rotation @ body.up)]

    def begin() -> Similarity:
        places = all_places.take(use[all_places.row])
        x = places.xyz @ level.rotation
        closed = closed_start(places, x) if settings.start == "closed" else None
        if closed is not None:
            return closed
        thin = closed_start(places, x, THINNEST_PLACES) if settings.start == "closed" else None
        _analysed(observed, use, body, thin or scaled(observed, use, body, level), settings, what)
        if settings.start == "closed":
            return searched_start(observe, body, use, thin)[0]
        return (two_point_start if settings.start == "two_points" else centroid_start)(places, x, body, what)

    def begin_without(exchanged: Int) -> Similarity:
        use[exchanged] = False
        try:
            start = begin()
            _analysed(observed, use, body, start, settings, what)
        except GeometryError as error:
            names = " and ".join(all_places.name[np.isin(all_places.row, exchanged)].tolist())
            text = f"{error.what}; {names} fit with each other's number"
            raise GeometryError(text, remedy="exchange the two numbers in the control, or " + error.remedy) from error
        return start

    try:
        start, failure = begin_without(exchanged) if len(exchanged) else begin(), None
    except ConvergenceError as error:
        if not settings.exchanged:
            raise
        start, failure = level, error
    if len(exchanged):
        return start
    places = all_places.take(use[all_places.row])
    x = places.xyz @ level.rotation
    if settings.exchanged and (failure is not None or not fits(places, x, body, start)):
        agreeing = agreeing_places(places, x, body, _up(observed, body))
        if agreeing is not None and (closed := closed_start(places.take(agreeing), x[agreeing], THINNEST_PLACES)):
            use[places.row[places.given.all(axis=1) & ~agreeing]] = False
            return closed
        exchanged = exchanged_by_all(observed, observe, body, use, level)
        if len(exchanged):
            return begin_without(exchanged)
        if failure is not None:
            raise failure
    return start


def _adjusted(problem: TiedProblem, began: Bool, settings: OrientationSettings) -> TiedResult:
    search = Snooping(settings.limit, clear=Snooping.clear if settings.rejects else np.inf)
    if settings.stiff:
        tied = adjust_tied(problem, search, active=began, deformed=False)
        fits = tied.settled and not tied.above.any() and tied.sigma0 <= STIFF_SIGMA0
        several = len(given_places(problem.observed, problem.start).row) > 1  # of one place nothing bends a scale
        if fits and tied.redundancy >= (STIFF_REDUNDANCY if several else 1):
            return tied
    return adjust_tied(problem, search, active=began)


def _analysed(
    observed: Sequence[Observed], use: Bool, body: FreeBody, to: Similarity, settings: OrientationSettings, what: str
) -> DatumAnalysis:
    """What the used observations determine; an error if that is not all, but where the datum may be free."""
    state = state_of(observed, body, to)
    analysis = analyse_datum(observed, state, transform(to, body.places), use, settings.weakest)
    if not analysis.open or settings.free:
        return analysis
    places = given_places(observed, state)
    open_error = OpenDatumError if use.all() else GeometryError
    if not len(places.row):
        raise open_error(f"{what}: not determined, {NOTHING}", remedy=ENOUGH)
    used, is_given = use[places.row], places.given.any(axis=1)
    counted = places.given[used]
    full, plan = int(counted.all(axis=1).sum()), int((counted[:, :2].all(axis=1) & ~counted[:, 2]).sum())
    height = int((counted[:, 2] & ~counted[:, :2].any(axis=1)).sum())
    counts = f"{full} known in X, Y and Z, {plan} in plan only, {height} in height only"
    out = places.name[~used & is_given].tolist()
    rejected = f"; rejected: {shown(out)}" if out else ""
    raise open_error(
        f"{what}: not determined: {', '.join(analysis.open)} (control and observed positions: {counts}{rejected})",
        remedy=OFF_THE_LINE if any("line" in text for text in analysis.open) else ENOUGH,
    )
