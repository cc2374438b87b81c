"""Strip block adjustment with polynomials: all strips to the ground at once, each with its own deformation.

A point of strip j, oriented approximately to x, is corrected by a polynomial in the strip's own axes,

    X = x + G_j (a_j'p, b_j'p, c_j'p) + v,        p = (1, U, V, U^2, U V),

and observes the unknown ground point X; so does control (orientation.tied_strips: ground points are eliminated, points
in any number of strips are weighted rightly, the standard deviation of the strips' points is estimated). The problem is
linear.

Degree: it begins at the degree asked for, for plan (a and b) and height (c) of every strip apart, and falls until all
coefficients are determined:

- by rank: eigenvalues of the unit-diagonal normal matrix below `RANK`; the strips in their null vectors fall by one;
- by sense: a strip falls if the corrections of its points, RMS, would be less precise than `WORST` times a single point
  of a strip: it would extrapolate.

Both are judged with equal weights of all strips' points and control held, so that they depend on geometry alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.geometry.polynomials import COUNT, TERMS, StripAxes, correction_design
from aatri.orientation.free_block.component_growth import StripPoints
from aatri.orientation.free_block.tie_elimination import Control, Linearised, Observations, eliminate, observations_of
from aatri.orientation.free_block.tied_adjustment import Problem, TiedResult, adjust_tied

RANK = 1e-7
WORST = 2.0
LIMIT = 4.0
COEFFICIENTS = 15
PART = np.repeat([0, 0, 1], 5)
"""Plan (0) or height (1), per coefficient."""

TERM_DEGREE = np.tile([0, 1, 1, 2, 2], 3)
PARTS = ("plan", "height")


@dataclass(frozen=True)
class Fall:
    """A strip that fell to a lower degree, and why."""

    strip: int
    part: str
    degree: int
    reason: str


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
    degree : int
        Highest degree, 0 to 2.
    active : (n + n_control,) bool, optional
        Observations to begin with; the others are tested for re-admission.
    limit : float
        Test statistic of a wrong tie or control point.
    """
    observations = observations_of(points.strip, points.point, n_points, control)
    design = np.zeros((len(observations.strip), 3, COEFFICIENTS))
    for k, strip in enumerate(axes):
        rows = points.strip == k
        design[np.flatnonzero(rows)] = correction_design(strip, points.xyz[rows])
    xyz = np.concatenate([points.xyz, np.where(control.given, control.xyz_m, 0.0)])
    covariance = np.concatenate([points.covariance, control.covariance_m2])
    use = np.ones(len(observations.strip), dtype=bool) if active is None else active
    degrees, falls = _determined_degrees(observations, design, use, np.full((len(axes), 2), degree))
    kept = np.flatnonzero(_kept(degrees))

    def linearise(coefficients: Float) -> Linearised:
        of_block = coefficients.reshape(-1, COEFFICIENTS)[observations.block]
        return Linearised(xyz + np.einsum("nik,nk->ni", design, of_block), design, covariance)

    problem = Problem(observations, linearise, lambda theta, step: theta + step, "strip block adjustment", kept)
    tied = adjust_tied(problem, np.zeros(len(axes) * COEFFICIENTS), limit=limit, active=use)
    solved = linearise(tied.state)
    strips_only = tied.active & (observations.strip >= 0)
    variance = np.diag(tied.covariance)
    sigma = np.where(variance > 0, np.sqrt(variance), np.nan)
    return StripPolynomials(
        degree=degrees,
        falls=tuple(falls),
        coefficients_m=tied.state.reshape(-1, 3, 5),
        sigma_m=sigma.reshape(-1, 3, 5),
        corrected_m=solved.xyz_m[: len(points.strip)],
        point_m=eliminate(observations, linearise(tied.state), strips_only, tied.tau_m).point_m,
        tied=tied,
    )


def _kept(degrees: Int) -> Bool:
    """Coefficients (n_strips * 15) within the degrees."""
    return np.asarray(degrees[:, PART] >= TERM_DEGREE).ravel()


def _determined_degrees(observations: Observations, design: Float, use: Bool, degrees: Int) -> tuple[Int, list[Fall]]:
    degrees, falls = degrees.copy(), []
    equal = np.where((observations.strip >= 0)[:, None, None], np.eye(3), 0.0)
    N = eliminate(observations, Linearised(np.zeros((len(equal), 3)), design, equal), use, 0.0).N
    for part in (0, 1):
        while (degrees[:, part] >= 0).any():
            kept = np.flatnonzero(_kept(degrees) & np.tile(part == PART, len(degrees)))
            reasons = _undetermined(N[np.ix_(kept, kept)], kept)
            if not reasons:
                reasons = _extrapolating(N[np.ix_(kept, kept)], kept, part, design, observations)
            if not reasons:
                break
            for strip, reason in sorted(reasons.items()):
                degrees[strip, part] -= 1
                falls.append(Fall(strip, PARTS[part], int(degrees[strip, part]), reason))
    return degrees, falls


def _undetermined(N: Float, kept: Int) -> dict[int, str]:
    """Strips in the null vectors of the unit-diagonal normal matrix, with what is open."""
    diagonal = np.diag(N)
    empty = diagonal <= 1e-12 * diagonal.max(initial=1.0)
    scale = np.where(empty, 1.0, np.sqrt(np.where(empty, 1.0, diagonal)))
    unit = np.where(empty[:, None] | empty[None, :], 0.0, N / np.outer(scale, scale))
    values, vectors = np.linalg.eigh(unit)
    missing = values < RANK
    weight = (vectors[:, missing] ** 2).sum(1)
    strip, coefficient = np.divmod(kept, COEFFICIENTS)
    involved = np.bincount(strip, weight)
    reasons = {}
    for k in np.flatnonzero(involved > 0.1 * max(involved.max(), 1e-9)):
        mine = np.flatnonzero(strip == k)
        largest = mine[np.argsort(-weight[mine], kind="stable")][:4]
        named = [f"{'abc'[c // 5]}_{TERMS[c % 5]}" for c in coefficient[largest[weight[largest] > 0.05]]]
        reasons[int(k)] = f"rank {len(N) - missing.sum()} of {len(N)}, not determined: {', '.join(named)}"
    return reasons


def _extrapolating(N: Float, kept: Int, part: int, design: Float, observations: Observations) -> dict[int, str]:
    """Strips whose corrections would be far less precise than a single point."""
    scale = np.sqrt(np.diag(N))
    Q = np.linalg.inv(N / np.outer(scale, scale)) / np.outer(scale, scale)
    strip, coefficient = np.divmod(kept, COEFFICIENTS)
    factor = np.zeros(int(strip.max()) + 1)
    for k in np.unique(strip):
        mine = strip == k
        J = design[observations.strip == k][:, :, coefficient[mine]]
        spread = np.einsum("nik,kl,nil->n", J, Q[np.ix_(mine, mine)], J)
        factor[k] = np.sqrt(spread.mean() / (2 - part)) if len(J) else np.inf
    # Strips hang together: with one that extrapolates fall those that nearly do, or its misfit would go to them.
    lower = (factor > WORST / 2) & (factor.max() > WORST)
    return {int(k): f"corrections {factor[k]:.1f} times less precise than a point" for k in np.flatnonzero(lower)}


def model_name(degree: int) -> str:
    """`polynomial_2` ...; `similarity` without correction."""
    return f"polynomial_{degree}" if degree >= 0 else "similarity"


def terms_of(degree: int) -> tuple[str, ...]:
    """Names of the terms of a degree."""
    return TERMS[: COUNT[degree]]
