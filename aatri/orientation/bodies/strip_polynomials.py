"""Strip block adjustment: all strips to the ground at once, each with its own deformation, polynomial or conformal.

A point of strip j, oriented approximately to x, is corrected by a polynomial in the strip's own axes,

    X = x + G_j (a_j'p, b_j'p, c_j'p) + v,        p = (1, U, V, U^2, U V),

and observes the unknown ground point X; so does control (tied_adjustment: ground points are eliminated, points in any
number of strips are weighted rightly, the standard deviation of the strips' points is estimated). The problem is
linear. The degree falls to what control and ties determine (determined_degrees).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aatri.adjusting.tied_adjustment import TiedResult, adjust_tied, snooping_of
from aatri.adjusting.tied_problem import TiedProblem, tied_problem
from aatri.arrays import Bool, Float, Int, Text
from aatri.geometry.strip_bases import SECOND_DEGREE, StripAxes, StripBasis
from aatri.notes import Level, Note
from aatri.observations.control import Control, observed_control
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT
from aatri.observations.ties import BODY, STRIP_TIE
from aatri.orientation.bodies.component_growth import BodyPoints
from aatri.orientation.bodies.determined_degrees import PARTS, Fall, determined_degrees, kept_coefficients
from aatri.orientation.bodies.similarity_ties import polynomial_ties, products_of_points

MOST_NAMED = 6
"""Strips that fell alike, up to which each has a warning of its own."""


@dataclass(frozen=True)
class StripPolynomials:
    """Result of the strip block adjustment."""

    degree: Int
    """(n_strips, 2). Of plan and height; -1 without correction."""
    falls: tuple[Fall, ...]
    basis: StripBasis
    coefficients_m: Float
    """(n_strips, K), m. In the order of the basis."""
    corrected_m: Float
    """(n, 3), m. Strip points with their corrections."""
    point_m: Float
    """(n_points, 3), m. Weighted mean over the strips, control not counted; NaN where no strip holds the point."""
    tied: TiedResult
    """The adjustment; observations are the strip points and then the control."""


def adjust_strip_polynomials(
    points: BodyPoints,
    n_points: int,
    axes: Sequence[StripAxes],
    control: Control,
    *,
    names: Text | None = None,
    point_ids: Text | None = None,
    degree: int | Int = 2,
    basis: StripBasis = SECOND_DEGREE,
    begin: Callable[[Sequence[Observed]], Bool] | None = None,
    limit: float | None = None,
    undoubted: Bool | None = None,
    after: tuple[Bool, float] | None = None,
) -> StripPolynomials:
    """Adjust all strips together.

    Parameters
    ----------
    points : BodyPoints
        On the ground, approximately; unit m, reduced to an origin near the block.
    axes : (n_strips,) sequence of StripAxes
    control : Control
        Points without any strip take no part.
    names, point_ids : str, optional
        Of the strips, and of all points; default: their numbers.
    degree : int or (n_strips,) int
        Highest degree, 0 to that of the basis.
    begin : callable, optional
        Strip points and control -> which of them to begin with; the others are tested for re-admission.
    limit : float, optional
        Test statistic of a wrong tie or control point; default: by the number of tests.
    undoubted : (n,) bool, optional
        Observations that are not rejected, strip points and control.
    after : (n,) bool and float, m, optional
        Of `adjust_tied`.
    """
    degrees, falls = np.tile(np.broadcast_to(degree, len(axes))[:, None], (1, 2)), []
    strips = np.arange(len(axes)).astype(np.str_) if names is None else names
    ids = np.arange(n_points).astype(np.str_) if point_ids is None else point_ids
    start = np.zeros((len(axes), basis.size))
    ties = polynomial_ties(points, axes, names=strips, free=np.ones(start.shape, dtype=bool), basis=basis)
    of_ties = ties.observed(STRIP_TIE, strips[points.strip], ids[points.point], start)
    of_control = observed_control(control, np.zeros(3), ids[control.point])
    at = {POINT: ties.places(start, n_points)}

    def with_free(free: Bool) -> TiedProblem:
        ties_there = replace(of_ties, unknowns=(replace(ties.unknowns, free=free),))
        return tied_problem([ties_there, *of_control], at, {POINT: ids}, "strip block adjustment")

    complete = with_free(ties.unknowns.free)
    use = np.ones(complete.edges[-1], dtype=bool) if begin is None else begin(complete.observed)
    products, rule = products_of_points(points, axes, basis), snooping_of(complete, limit)
    while True:
        degrees, fell = determined_degrees(complete, *products, use, degrees, basis)
        falls += fell
        free = kept_coefficients(degrees, basis)
        problem = complete if free.all() else with_free(free)
        tied = adjust_tied(problem, rule, active=use, undoubted=undoubted, after=after)
        # Rejected control determines nothing any more: if a degree falls for it, all is adjusted once more.
        lost = (use & ~tied.active)[len(points.strip) :].any()
        if not lost or not determined_degrees(complete, *products, tied.active, degrees, basis)[1]:
            break
        use, after = tied.active, None
    return StripPolynomials(
        degree=degrees,
        falls=tuple(falls),
        basis=basis,
        coefficients_m=tied.state[BODY],
        corrected_m=ties.on_ground(tied.state[BODY], ties.rows),
        point_m=tied.mean_m,
        tied=tied,
    )


def fall_notes(result: StripPolynomials, names: Sequence[str], level: Level = "warning") -> list[Note]:
    """Notes of strips that fell to a lower degree, for plan and height apart: one each, or one for many alike."""
    if (result.degree < 0).all():
        text = "no strip is corrected: control determines nothing of its own, they stay as `initial` has put them"
        return [Note("note", text)]
    fell: dict[tuple[str, str], dict[str, str]] = {}
    for fall in result.falls:
        model = result.basis.model(int(result.degree[fall.strip, PARTS.index(fall.part)]))
        reasons_of = fell.setdefault((fall.part, model), {})
        before = f"{reasons_of[names[fall.strip]]}; " if names[fall.strip] in reasons_of else ""
        reasons_of[names[fall.strip]] = f"{before}degree {fall.degree + 1}: {fall.reason}"
    notes = []
    for (part, model), reasons_of in fell.items():
        if len(reasons_of) <= MOST_NAMED:
            notes += [
                Note(level, f"strip {name}, {part}: {model}, as {reasons}") for name, reasons in reasons_of.items()
            ]
            continue
        first, reasons = next(iter(reasons_of.items()))
        text = f"{part}: {model} in {len(reasons_of)} of {len(names)} strips; in strip {first}, as {reasons}"
        notes.append(Note(level, text, tuple(reasons_of)))
    return notes


def textbook_counts(result: StripPolynomials, points: BodyPoints, control: Control) -> tuple[int, int]:
    """Equations and coefficients as textbooks count them, without the ground points.

    A coordinate that is known gives every strip that holds its point an equation, one that is not gives an equation
    between every two neighbours of the k strips: k - 1. The difference is the redundancy all the same.
    """
    n = int(max(points.point.max(initial=0), control.point.max(initial=0))) + 1
    used = result.tied.active[: len(points.point)]
    strips = np.bincount(points.point[used], minlength=n)
    has_control = np.zeros((n, 3), dtype=bool)
    of_control = result.tied.active[len(points.point) :]
    np.logical_or.at(has_control, control.point[of_control], control.given[of_control])
    equations = np.where(has_control, strips[:, None], np.maximum(strips[:, None] - 1, 0)).sum()
    return int(equations), int(kept_coefficients(result.degree, result.basis).sum())
