"""Strip block adjustment with polynomials: all strips to the ground at once, each with its own deformation.

A point of strip j, oriented approximately to x, is corrected by a polynomial in the strip's own axes,

    X = x + G_j (a_j'p, b_j'p, c_j'p) + v,        p = (1, U, V, U^2, U V),

and observes the unknown ground point X; so does control (tied_adjustment: ground points are eliminated, points in any
number of strips are weighted rightly, the standard deviation of the strips' points is estimated). The problem is
linear. The degree falls to what control and ties determine (determined_degrees).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aatri.adjustment.statistics.rejection import Snooping
from aatri.arrays import Bool, Float, Int, Text
from aatri.geometry.polynomials import COUNT, TERMS, StripAxes
from aatri.notes import Note
from aatri.observations.control import Control
from aatri.orientation.free_block.component_growth import StripPoints
from aatri.orientation.free_block.determined_degrees import PARTS, Fall, determined_degrees, kept_coefficients
from aatri.orientation.free_block.polynomial_ties import COEFFICIENTS, polynomial_ties, terms_of_points
from aatri.orientation.free_block.tie_records import GivenPoints
from aatri.orientation.free_block.tied_adjustment import TiedResult, adjust_indexed
from aatri.orientation.free_block.tied_solution import TiedProblem, tied_problem

LIMIT = 4.0


@dataclass(frozen=True)
class StripPolynomials:
    """Result of the strip block adjustment.

    Attributes
    ----------
    degree : (n_strips, 2) int
        Of plan and height; -1 without correction.
    falls : tuple of Fall
    coefficients_m, sigma_m : (n_strips, 3, 5) float64, m
        Of dU, dV, dW; sigma NaN where not estimated.
    corrected_m : (n, 3) float64, m
        Strip points with their corrections.
    point_m : (n_points, 3) float64, m
        Weighted mean over the strips, control not counted; NaN where no strip holds the point.
    tied : TiedResult
        The adjustment; observations are the strip points and then the control.
    """

    degree: Int
    falls: tuple[Fall, ...]
    coefficients_m: Float
    sigma_m: Float
    corrected_m: Float
    point_m: Float
    tied: TiedResult[Float]


def adjust_strip_polynomials(
    points: StripPoints,
    n_points: int,
    axes: Sequence[StripAxes],
    control: Control,
    *,
    names: Sequence[str] | Text | None = None,
    degree: int = 2,
    active: Bool | None = None,
    limit: float = LIMIT,
) -> StripPolynomials:
    """Adjust all strips together.

    Parameters
    ----------
    points : StripPoints
        On the ground, approximately; unit m, reduced to an origin near the block.
    n_points : int
    axes : (n_strips,) sequence of StripAxes
    control : Control
        Points without any strip take no part.
    names : (n_strips,) sequence of str, optional
        Of the strips, for messages.
    degree : int
        Highest degree, 0 to 2.
    active : (n + n_control,) bool, optional
        Observations to begin with; the others are tested for re-admission.
    limit : float
        Test statistic of a wrong tie or control point.
    """
    use = np.ones(len(points.strip) + len(control.point), dtype=bool) if active is None else active
    degrees, falls = np.full((len(axes), 2), degree), []
    given = GivenPoints("control", control.point, control.xyz_m, control.covariance_m2, control.given)
    strip_names = [str(k) for k in range(len(axes))] if names is None else names
    start = np.zeros((len(axes), COEFFICIENTS))
    ties = polynomial_ties(points, axes, names=strip_names, n_points=n_points, free=np.ones(start.shape, dtype=bool))
    whole = tied_problem(ties, [given], start, "strip block adjustment")
    p = terms_of_points(points, axes)
    while True:
        degrees, fell = determined_degrees(whole, p, use, degrees)
        falls += fell
        free = kept_coefficients(degrees)
        tied = adjust_indexed(whole if free.all() else _with_free(whole, free), start, Snooping(limit), active=use)
        # Rejected control determines nothing any more: if a degree falls for it, all is adjusted once more.
        lost = (use & ~tied.active)[len(points.strip) :].any()
        if not lost or not determined_degrees(whole, p, tied.active, degrees)[1]:
            break
        use = tied.active
    return StripPolynomials(
        degree=degrees,
        falls=tuple(falls),
        coefficients_m=tied.state.reshape(-1, 3, 5),
        sigma_m=np.where(free, tied.sigma, np.nan).reshape(-1, 3, 5),
        corrected_m=ties.on_ground(tied.state, ties.rows),
        point_m=tied.mean_m,
        tied=tied,
    )


def _with_free(problem: TiedProblem[Float], free: Bool) -> TiedProblem[Float]:
    """The problem with other coefficients held at zero."""
    ties = replace(problem.ties, unknowns=replace(problem.ties.unknowns, free=free))
    return tied_problem(ties, problem.given, np.zeros(free.shape), problem.what)


def fall_notes(result: StripPolynomials, names: Sequence[str]) -> list[Note]:
    """A warning for every strip that fell to a lower degree, for plan and height apart."""
    notes = []
    for strip, name in enumerate(names):
        for column, part in enumerate(PARTS):
            falls = [fall for fall in result.falls if fall.strip == strip and fall.part == part]
            if falls:
                reasons = "; ".join(f"degree {fall.degree + 1}: {fall.reason}" for fall in falls)
                model = model_name(int(result.degree[strip, column]))
                notes.append(Note("warning", f"strip {name}, {part}: {model}, as {reasons}"))
    return notes


def model_name(degree: int) -> str:
    """`polynomial_2` ...; `similarity` without correction."""
    return f"polynomial_{degree}" if degree >= 0 else "similarity"


def terms_of(degree: int) -> tuple[str, ...]:
    """Names of the terms of a degree."""
    return TERMS[: COUNT[degree]]
