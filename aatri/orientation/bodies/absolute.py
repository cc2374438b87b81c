"""Absolute orientation: one similarity from a free component to the ground, from all its control together.

    X = T + s R x + v,      position of an antenna: X = T + s R x0 + R b + v

with x the component's points or projection centres, b the lever arm along the component's axes in metres. Control may
be full, plan only or height only; every coordinate has its role and its standard deviation. Components are deformed;
the deformation tau added to the standard deviation of their points is estimated together with the unknowns, so that
control of 2 cm and positions of 10 cm work together (adjusting.tied_adjustment: each control point is an unknown ground
point, observed in the component and in the control). Wrong control is found by data snooping.

Distances between points of the component and attitudes of its images take part with their weights (given_relations).

Start: see `datum_start`. What control leaves open is found beforehand and named (datum_analysis).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from aatri.adjusting.tied_adjustment import TiedResult, adjust_tied
from aatri.adjusting.tied_problem import tied_problem
from aatri.adjustment.statistics.rejection import Snooping
from aatri.arrays import Bool, Float, Int, Text
from aatri.errors import GeometryError
from aatri.geometry.rotations import levelling
from aatri.geometry.similarity import Similarity, compose, robust_closed_form, transform
from aatri.ids import shown
from aatri.observations.control import Control, observed_control
from aatri.observations.observed import Observed, named
from aatri.observations.poses import POINT
from aatri.observations.positions import KIND as POSITION
from aatri.observations.ties import BODY, COMPONENT_POINT
from aatri.orientation.bodies.datum import Datum
from aatri.orientation.bodies.datum_analysis import UNDETERMINED, DatumAnalysis, analyse_datum
from aatri.orientation.bodies.datum_start import attitude_of, levelled_start, turned_start
from aatri.orientation.bodies.exchanged_control import FEWEST, exchanged_control
from aatri.orientation.bodies.similarity_ties import similarities_of, similarity_ties

CONTROL_LIMIT = 5.0
"""Test statistic of wrong control; larger than for pure noise, as a component is deformed smoothly."""


UPWARDS, STEEPLY = 0.17, 0.7
"""Sines of the elevations, 10 and 45 degrees, above which the images look upwards, and steeply so, in the mean."""

STIFF, LEFT = 2.0, 4
"""Largest sigma0 and least redundancy without what was rejected, for gross errors to be told from deformation."""

FEWEST_MIRRORED, CLEARLY = 5, 0.2
"""Fewer full points say nothing of whether mirrored ones fit better: whether their misfit is less than this share."""


@dataclass(frozen=True)
class OrientedComponent:
    """Result of the absolute orientation of a component.

    Attributes
    ----------
    ground_from_component : Similarity
    residual_m : (n, 3) float64, m
        Component on the ground minus given, of control and positions; NaN where not given.
    active : (n,) bool
        Control and positions that are not rejected.
    analysis : DatumAnalysis
    tied : TiedResult
        The adjustment: first the points of the component, then control and positions, then distances and attitudes.
    """

    ground_from_component: Similarity
    residual_m: Float
    active: Bool
    analysis: DatumAnalysis
    tied: TiedResult


def orient_component(
    datum: Datum,
    body: Float,
    up: Float,
    *,
    what: str,
    active: Bool | None = None,
    limit: float = CONTROL_LIMIT,
    two_points: bool = False,
    weakest: float = UNDETERMINED,
    stiff: bool = False,
) -> OrientedComponent:
    """Orient one component.

    Parameters
    ----------
    datum : Datum
    body : (m, 3) float64, unit of the component
        All points of the component: what the orientation has to carry.
    up : (3,) float64
        Direction against the mean viewing direction of its images, in the component.
    what : str
        The component, for messages.
    active : (n,) bool, optional
        Rows of the datum to begin with; the others are tested for re-admission.
    limit : float
        Test statistic of wrong control.
    two_points : bool
        Start from two points.
    weakest : float
        Motions known less well count as not determined; see `datum_analysis`.
    stiff : bool
        The component comes from an adjustment of all its images: where all else fits without some gross errors, they
        are told from a deformation, which a few wrong points would otherwise be taken for.

    Raises
    ------
    GeometryError
        If something is not determined; the message names it. If the images would look upwards.
    """
    use: Bool = np.asarray(datum.given.any(1))
    if active is not None:
        use = use & active
    use[_exchanged(datum, use)] = False
    rotation, closed = (levelling(up), None) if two_points else attitude_of(datum, up, use)
    _analysed(datum, use, None, rotation, body, what, weakest)
    if closed is not None:
        start = closed
    elif datum.attitudes is not None and not two_points:
        start = turned_start(datum, rotation, use, what)
    else:
        start = levelled_start(datum, rotation, use, what, two_points=two_points)
    tied, centre = _adjust(datum, start, use, limit, what, stiff=stiff)
    n, m = len(datum.x), datum.coordinates
    kept = np.zeros(n, dtype=bool)
    kept[:m] = tied.active[n : n + m] & datum.given[:m].any(1)
    similarity = compose(tied.state[BODY][0], Similarity(-centre, 1.0, np.eye(3)))
    if datum.attitudes is None and (why := _mirrored(datum, kept, similarity, up)):
        if len(two := _exchanged(datum, np.asarray(datum.given.any(1)), fewest=3)):
            text = f"{what}: {why}, unless {' and '.join(datum.name[k] for k in two)} have each other's number"
            raise GeometryError(text, remedy="exchange the two numbers in the control, or leave both out")
        raise GeometryError(
            f"{what}: {why}",
            remedy="declare the axes of the control in their true order, [north, east, up] or [east, north, up]; check "
            "the y axis of the image coordinates (pixel: y)",
        )
    # What remains must still determine the component: rejected control does not count.
    kinds = [*(d.kind for d in datum.distances), *([] if datum.attitudes is None else [datum.attitudes.kind])]
    others = [tied.of(kind) for kind in kinds]
    counting = tied.active[np.concatenate([np.zeros(0, dtype=np.int64), *others])]
    analysis = _analysed(datum, kept, counting, similarity.rotation, body, what, weakest)
    residual = np.where(datum.given, transform(similarity, datum.x, datum.offset_m) - datum.xyz_m, np.nan)
    return OrientedComponent(similarity, residual[:m], tied.active[n : n + m], analysis, tied)


def _exchanged(datum: Datum, use: Bool, fewest: int = FEWEST) -> Int:
    """Rows of two control points with each other's number; none otherwise."""
    m = datum.coordinates
    first = m if datum.n_control is None else datum.n_control
    full = np.flatnonzero(datum.given[:m].all(1) & use[:m])
    return full[exchanged_control(datum.x[full], datum.xyz_m[full], int((full < first).sum()), fewest)]


def _mirrored(datum: Datum, kept: Bool, similarity: Similarity, up: Float) -> str:
    """Why control or images must be mirrored: control fits much better mirrored, or the images look upwards.

    Images of facades, or of what stands above them, may look upwards rightly. Points in a plane fit as well when they
    are mirrored; of these it counts how steeply the images look upwards.
    """
    steep = -float((similarity.rotation @ up)[2]) / float(np.linalg.norm(up))
    text = "oriented by its control the images look upwards, so the control is mirrored"
    full = np.flatnonzero(datum.given.all(1) & kept)
    if len(full) >= FEWEST_MIRRORED:
        x, X = transform(similarity, datum.x[full], datum.offset_m[full]), datum.xyz_m[full]
        as_it_is, other = (np.median(robust_closed_form(x, X * [1.0, 1.0, sign])[1]) for sign in (1.0, -1.0))
        if other < CLEARLY * as_it_is:
            return text if steep > UPWARDS else "control and positions fit it mirrored only"
        if as_it_is < CLEARLY * other:
            return ""
    return text if steep > STEEPLY else ""


def _analysed(
    datum: Datum, use: Bool, others: Bool | None, rotation: Float, body: Float, what: str, weakest: float
) -> DatumAnalysis:
    """What the used rows determine, in a levelled frame; an error if that is not all.

    `others` are the distances and attitudes that count; None: all.
    """
    names = [datum.name[k] for k in np.flatnonzero(use)]
    lines = [datum.x[d.sights.target] - datum.x[d.sights.station] for d in datum.distances]
    length = np.linalg.norm(np.concatenate([np.zeros((0, 3)), *lines]), axis=1)
    turned = 0 if datum.attitudes is None else len(datum.attitudes.row)
    if others is not None:
        length, turned = length[others[: len(length)]], int(others[len(length) :].sum())
    analysis = analyse_datum(
        datum.x[use] @ rotation.T,
        datum.given[use],
        names,
        body @ rotation.T,
        length=length,
        turned=turned,
        weakest=weakest,
    )
    if analysis.open or analysis.defect:
        raise GeometryError(_undetermined(datum, use, analysis, what), remedy=_remedy(analysis))
    return analysis


def _adjust(
    datum: Datum, start: Similarity, use: Bool, limit: float, what: str, *, stiff: bool
) -> tuple[TiedResult, Float]:
    n, m = len(datum.x), datum.coordinates
    centre = datum.x[use].mean(0)
    ties = similarity_ties(
        np.zeros(n, dtype=np.int32),
        np.arange(n),
        datum.x - centre,
        datum.covariance,
        names=[what],
        offset_m=datum.offset_m,
    )
    begin = similarities_of([compose(start, Similarity(centre, 1.0, np.eye(3)))])
    names = np.array(datum.name, dtype=np.str_) if datum.id is None else datum.id
    observed = [ties.observed(COMPONENT_POINT, np.full(n, what), names, begin), *_of_datum(datum, names)]
    active = np.concatenate([np.ones(n, dtype=bool), use[:m]])
    active = np.append(active, np.ones(sum(len(o) for o in observed) - len(active), dtype=bool))
    what = f"absolute orientation of {what}"
    problem = tied_problem(observed, {POINT: ties.places(begin, n)}, {POINT: names}, what)
    rule = Snooping(limit)
    if stiff:
        tied = adjust_tied(problem, rule, active=active, deformed=False)
        fits = tied.settled and not tied.above.any() and tied.sigma0 <= STIFF
        if fits and tied.redundancy >= (LEFT if m > 1 else 1):  # of one point: nothing bends a scale
            return tied, centre
    return adjust_tied(problem, rule, active=active), centre


def _of_datum(datum: Datum, names: Text) -> Iterator[Observed]:
    """Control, positions, distances and attitudes as observations of the rows of a datum and of the body."""
    m = datum.coordinates
    first = m if datum.n_control is None else datum.n_control
    for kind, of in zip(datum.kinds, (np.arange(first), np.arange(first, m))):
        given, C = datum.given[of], datum.covariance_m2[of]
        exact = given & (np.einsum("nii->ni", C) == 0)
        row = of if datum.row is None else datum.row[of]
        rows = Control(row.astype(np.int32), of.astype(np.int32), datum.xyz_m[of], C, given & ~exact, exact)
        for o in observed_control(rows, np.zeros(3), names[of], kind=kind):
            yield replace(o, names=named(names[of])) if kind == POSITION else o
    for distances in datum.distances:
        yield from distances.observed()
    if datum.attitudes is not None:
        yield datum.attitudes.observed()


def _counts(datum: Datum, use: Bool) -> str:
    given = datum.given[use]
    full = int(given.all(1).sum())
    plan = int((given[:, :2].all(1) & ~given[:, 2]).sum())
    height = int((given[:, 2] & ~given[:, :2].any(1)).sum())
    return f"{full} known in X, Y and Z, {plan} in plan only, {height} in height only"


def _undetermined(datum: Datum, use: Bool, analysis: DatumAnalysis, what: str) -> str:
    if not datum.given.any():
        return f"{what}: not determined, it holds no control point and no observed position"
    out = [name for name, used, given in zip(datum.name, use, np.asarray(datum.given.any(1))) if given and not used]
    rejected = f"; rejected: {shown(out)}" if out else ""
    open_ = ", ".join(analysis.open) or f"{analysis.defect} of the seven parameters"
    return f"{what}: not determined: {open_} (control and observed positions: {_counts(datum, use)}{rejected})"


def _remedy(analysis: DatumAnalysis) -> str:
    if any("line" in text for text in analysis.open):
        return "add a point with a known height well off that line, or observed positions of images in another strip"
    return "at least two points known in plan and three in height, not on a line, or as many observed positions"
