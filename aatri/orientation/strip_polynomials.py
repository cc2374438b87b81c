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
import numpy.typing as npt

from aatri.geometry.polynomials import COUNT, TERMS, StripAxes, correction_design
from aatri.orientation.free_block import StripPoints
from aatri.orientation.tied_strips import (
    Control,
    Linearised,
    Observations,
    Problem,
    TiedResult,
    adjust_tied,
    block_rows,
    eliminate,
    observations_of,
)

Float = npt.NDArray[np.float64]
Int = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]

RANK = 1e-10
WORST = 3.0
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
        design[: len(points.strip)][rows] = correction_design(strip, points.xyz[rows])
    full = Linearised(
        np.concatenate([points.xyz, np.where(control.given, control.xyz_m, 0.0)]),
        block_rows(design, observations.strip, len(axes)),
        np.concatenate([points.covariance, control.covariance_m2]),
    )
    use = np.ones(len(observations.strip), dtype=bool) if active is None else active
    degrees, falls = _determined_degrees(observations, full, design, use, np.full((len(axes), 2), degree))
    kept = np.flatnonzero(_kept(degrees))
    J = full.jacobian[:, kept]

    def linearise(theta: Float) -> Linearised:
        return Linearised(full.xyz_m + (J @ theta).reshape(-1, 3), J, full.covariance_m2)

    problem = Problem(observations, linearise, lambda theta, step: theta + step, "strip block adjustment")
    tied = adjust_tied(problem, np.zeros(len(kept)), limit=limit, active=use)
    solved = linearise(tied.state)
    strips_only = tied.active & (observations.strip >= 0)
    coefficients, sigma = np.zeros(len(axes) * COEFFICIENTS), np.full(len(axes) * COEFFICIENTS, np.nan)
    coefficients[kept], sigma[kept] = tied.state, np.sqrt(np.diag(tied.covariance))
    return StripPolynomials(
        degree=degrees,
        falls=tuple(falls),
        coefficients_m=coefficients.reshape(-1, 3, 5),
        sigma_m=sigma.reshape(-1, 3, 5),
        corrected_m=solved.xyz_m[: len(points.strip)],
        point_m=eliminate(observations, solved, strips_only, tied.tau_m).point_m,
        tied=tied,
    )


def _kept(degrees: Int) -> Bool:
    """Coefficients (n_strips * 15) within the degrees."""
    return np.asarray(degrees[:, PART] >= TERM_DEGREE).ravel()


def _determined_degrees(
    observations: Observations, full: Linearised, design: Float, use: Bool, degrees: Int
) -> tuple[Int, list[Fall]]:
    degrees, falls = degrees.copy(), []
    strips = observations.strip >= 0
    equal = np.where(strips[:, None, None], np.eye(3), 0.0)
    while (degrees >= 0).any():
        kept = np.flatnonzero(_kept(degrees))
        N = eliminate(observations, Linearised(full.xyz_m, full.jacobian[:, kept], equal), use, 0.0).N
        lower, reason = _undetermined(N, kept, degrees)
        if not lower.any():
            lower, reason = _extrapolating(N, kept, degrees, design, observations)
        if not lower.any():
            break
        for strip, part in np.argwhere(lower):
            degrees[strip, part] -= 1
            falls.append(Fall(int(strip), PARTS[part], int(degrees[strip, part]), reason[strip, part]))
    return degrees, falls


def _undetermined(N: Float, kept: Int, degrees: Int) -> tuple[Bool, npt.NDArray[np.object_]]:
    """Strips and parts in the null vectors of the unit-diagonal normal matrix."""
    lower, reason = np.zeros(degrees.shape, dtype=bool), np.full(degrees.shape, "", dtype=object)
    # Control and ties may cancel to rounding: a diagonal this small against the others is none.
    diagonal = np.diag(N)
    empty = diagonal <= 1e-12 * diagonal.max(initial=1.0)
    scale = np.where(empty, 1.0, np.sqrt(np.where(empty, 1.0, diagonal)))
    unit = np.where(empty[:, None] | empty[None, :], 0.0, N / np.outer(scale, scale))
    values, vectors = np.linalg.eigh(unit)
    missing = values < RANK
    if not missing.any():
        return lower, reason
    weight = (vectors[:, missing] ** 2).sum(1)
    involved = np.zeros(len(degrees) * COEFFICIENTS)
    involved[kept] = weight
    parts = np.stack([involved.reshape(-1, COEFFICIENTS)[:, part == PART].sum(1) for part in (0, 1)], 1)
    lower = (parts > 0.1 * parts.max()) & (degrees >= 0)
    for strip, part in np.argwhere(lower):
        mine = [
            (f"{'abc'[k // 5]}_{TERMS[k % 5]}", involved[strip * COEFFICIENTS + k])
            for k in range(COEFFICIENTS)
            if PART[k] == part and involved[strip * COEFFICIENTS + k] > 0.05
        ]
        named = ", ".join(name for name, _ in sorted(mine, key=lambda pair: -pair[1])[:4])
        reason[strip, part] = f"rank {len(N) - missing.sum()} of {len(N)}; not determined: {named}"
    return lower, reason


def _extrapolating(
    N: Float, kept: Int, degrees: Int, design: Float, observations: Observations
) -> tuple[Bool, npt.NDArray[np.object_]]:
    """Strips and parts whose corrections would be far less precise than a single point."""
    Q = np.zeros((len(degrees) * COEFFICIENTS,) * 2)
    scale = np.sqrt(np.diag(N))
    Q[np.ix_(kept, kept)] = np.linalg.inv(N / np.outer(scale, scale)) / np.outer(scale, scale)
    factor = np.zeros(degrees.shape)
    for strip in range(len(degrees)):
        mine = slice(strip * COEFFICIENTS, (strip + 1) * COEFFICIENTS)
        J = design[observations.strip == strip]
        for part in (0, 1):
            of = np.flatnonzero(part == PART)
            spread = np.einsum("nik,kl,nil->n", J[:, :, of], Q[mine, mine][np.ix_(of, of)], J[:, :, of])
            factor[strip, part] = np.sqrt(spread.mean() / (2 - part)) if len(J) else 0.0
    factor[degrees < 0] = 0.0
    lower = (factor > WORST) & (factor >= 0.5 * factor.max())
    reason = np.full(degrees.shape, "", dtype=object)
    for strip, part in np.argwhere(lower):
        reason[strip, part] = f"the corrections would be {factor[strip, part]:.1f} times less precise than a point"
    return lower, reason


def model_name(degree: int) -> str:
    """`polynomial_2` ...; `similarity` without correction."""
    return f"polynomial_{degree}" if degree >= 0 else "similarity"


def terms_of(degree: int) -> tuple[str, ...]:
    """Names of the terms of a degree."""
    return TERMS[: COUNT[degree]]
