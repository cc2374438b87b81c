"""The degree of each strip's polynomial: what control and ties determine, for plan and height apart.

It begins at the degree asked for, for plan (a and b) and height (c) of every strip, and falls until all coefficients
are determined:

- by rank: eigenvalues of the unit-diagonal normal matrix below `RANK`; the strips in their null vectors fall by one;
- by sense: a strip falls if the corrections of its points, RMS, would be less precise than `WORST_EXTRAPOLATION` times
  a single point of a strip: it would extrapolate.

Both are judged with equal weights of all strips' points and control held, so that they depend on geometry alone: then
plan and height have nothing to do with each other. N is what the elimination of the ground points leaves.

Options of the adjustment of strips are the highest degrees, by free strips or by strips of the block, and limits.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field
from scipy.linalg import eigh

from aatri.adjusting.added_variance import observed_components
from aatri.adjusting.tied_problem import TiedProblem
from aatri.adjustment.elimination.reduced import reduced_normals
from aatri.adjustment.structure.weights import with_weights
from aatri.adjustment.threads import one_blas_thread
from aatri.arrays import Bool, Float, Int, Text
from aatri.errors import InputError
from aatri.geometry.strip_bases import SECOND_DEGREE, StripBasis
from aatri.ids import shown
from aatri.options import LimitOfTies, Options, Reliability
from aatri.orientation.bodies.limits import WORST_EXTRAPOLATION

RANK = 1e-7
HELD = 1e-2
"""Standard deviation of control, as a share of that of the strips' points."""

PARTS = ("plan", "height")


class StripBlockOptions(Options):
    """Options of a strip block adjustment."""

    degree: int = Field(2, ge=0, le=3, description="highest degree; it falls where control and ties determine less")
    degrees: dict[str, Annotated[int, Field(ge=0, le=3)]] = Field(
        {}, description="highest degree of single strips, by their ids; the others have `degree`"
    )
    limit: LimitOfTies = None
    max_sigma0: float | None = Field(
        None,
        gt=0,
        description="an error where strips deform by so many times what their length explains; null: a warning "
        "beyond 20 times",
    )
    reliability: Reliability = False

    @property
    def degrees_requested(self) -> bool:
        """A degree is stated: that it falls is a warning then."""
        return bool({"degree", "degrees"} & self.model_fields_set)

    @property
    def highest_degree(self) -> int:
        """Of all strips."""
        return max(self.degree, *self.degrees.values()) if self.degrees else self.degree

    def degrees_of(self, names: Text) -> Int:
        """Highest degree of every strip, (n_strips,).

        Parameters
        ----------
        names : (n_strips,) str
            Ids of free strips: those of the block, with .1 .2 ... where a strip is broken.

        Raises
        ------
        InputError
            If an id is that of no strip.
        """
        degrees = np.full(len(names), self.degree)
        ids = [str(name) for name in names]
        unsplit = [name.rpartition(".")[0] if name.rpartition(".")[2].isdigit() else name for name in ids]
        for strip, value in self.degrees.items():
            of_name = [k for k, name in enumerate(ids) if name == strip]
            of_name = of_name or [k for k, name in enumerate(unsplit) if name == strip]
            if not of_name:
                raise InputError(
                    f"`degrees` names strip {strip}, which is not among the strips {shown(ids)}",
                    remedy="give ids of free strips, as the log of strip formation lists them",
                )
            degrees[of_name] = value
        return degrees


@dataclass(frozen=True)
class Fall:
    """A strip that fell to a lower degree, and why."""

    strip: int
    part: str
    degree: int
    reason: str


def kept_coefficients(degrees: Int, basis: StripBasis = SECOND_DEGREE) -> Bool:
    """Coefficients within the degrees, (n_strips, K), from the degrees of plan and height, (n_strips, 2)."""
    return np.asarray(degrees[:, basis.part] >= basis.degree)


def determined_degrees(
    problem: TiedProblem, products: Float, count: Int, use: Bool, highest: Int, basis: StripBasis = SECOND_DEGREE
) -> tuple[Int, list[Fall]]:
    """Degrees of plan and height of every strip, and what fell.

    Parameters
    ----------
    problem : TiedProblem
        With all coefficients free; what is given is control.
    products : (n_strips, K, K) float64
        D'D with the derivatives D of the deformations of each strip's points (`products_of_points`).
    count : (n_strips,) int
        How many points each has.
    use : (n + n_control,) bool
        Observations that count: strip points, then control.
    highest : (n_strips, 2) int
        Degrees of plan and height to begin with.

    Returns
    -------
    degrees : (n_strips, 2) int
        -1 without correction.
    falls : list of Fall
    """
    with one_blas_thread():  # matrices of some hundred rows
        degrees, falls = highest.copy(), []
        N = _normal_matrix(problem, use)
        for part in (0, 1):
            while (degrees[:, part] >= 0).any():
                kept = np.flatnonzero(kept_coefficients(degrees, basis) & (part == basis.part))
                reasons = _undetermined(N[np.ix_(kept, kept)], kept, basis)
                if not reasons:
                    reasons = _extrapolating(N[np.ix_(kept, kept)], kept, part, products, count)
                if not reasons:
                    break
                for strip, reason in sorted(reasons.items()):
                    degrees[strip, part] -= 1
                    falls.append(Fall(strip, PARTS[part], int(degrees[strip, part]), reason))
        return degrees, falls


def _normal_matrix(problem: TiedProblem, use: Bool) -> Float:
    """N of all coefficients, the ground points eliminated."""
    ties = [np.broadcast_to(np.eye(3), (len(o), 3, 3)) for o in problem.ties]
    fixing = [np.eye(3) / HELD * observed_components(o)[:, :, None] for o in problem.ground]
    weights = problem.weights(use & problem.taking_part(use), [*ties, *fixing])
    return reduced_normals(with_weights(problem.index, weights), problem.start).N


def _undetermined(N: Float, kept: Int, basis: StripBasis) -> dict[int, str]:
    """Strips in the null vectors of the unit-diagonal normal matrix, with what is open."""
    diagonal = np.diag(N)
    empty = diagonal <= 1e-12 * diagonal.max(initial=1.0)
    scale = np.where(empty, 1.0, np.sqrt(np.where(empty, 1.0, diagonal)))
    unit = np.where(empty[:, None] | empty[None, :], 0.0, N / np.outer(scale, scale))
    if not empty.any() and _above_rank(unit):
        return {}
    try:
        null = eigh(unit, subset_by_value=(-np.inf, RANK))[1]
    except np.linalg.LinAlgError:  # where eigenvalues are double, LAPACK's choice by value may fail
        values, vectors = np.linalg.eigh(unit)
        null = vectors[:, values <= RANK]
    weight = (null**2).sum(1)
    strip, coefficient = np.divmod(kept, basis.size)
    involved = np.bincount(strip, weight)
    reasons = {}
    for k in np.flatnonzero(involved > 0.1 * max(involved.max(), 1e-9)):
        of_strip = np.flatnonzero(strip == k)
        largest = of_strip[np.argsort(-np.round(weight[of_strip], 6), kind="stable")][:4]
        named = [basis.labels[c] for c in coefficient[largest[weight[largest] > 0.05]]]
        reasons[int(k)] = f"rank {len(N) - null.shape[1]} of {len(N)}, not determined: {', '.join(named)}"
    return reasons


def _above_rank(unit: Float) -> bool:
    """Whether all eigenvalues are above `RANK`: what a Cholesky factor tells at less cost."""
    try:
        np.linalg.cholesky(unit - RANK * np.eye(len(unit)))
    except np.linalg.LinAlgError:
        return False
    return True


def _extrapolating(N: Float, kept: Int, part: int, products: Float, count: Int) -> dict[int, str]:
    """Strips whose corrections would be far less precise than a single point."""
    scale = np.sqrt(np.diag(N))
    Q = np.linalg.inv(N / np.outer(scale, scale)) / np.outer(scale, scale)
    strip, coefficient = np.divmod(kept, products.shape[1])
    factor = np.zeros(int(strip.max()) + 1)
    for k in np.unique(strip):
        of_strip = np.flatnonzero(strip == k)
        # The axes are orthogonal, so that the variances along them add up to those on the ground.
        mean = products[k][np.ix_(coefficient[of_strip], coefficient[of_strip])] / max(count[k], 1)
        spread = float((Q[np.ix_(of_strip, of_strip)] * mean).sum())
        factor[k] = np.sqrt(spread / (2 - part)) if count[k] else np.inf
    # Strips hang together: with one that extrapolates fall those that nearly do, or its misfit would go to them.
    lower = (factor > WORST_EXTRAPOLATION / 2) & (factor.max() > WORST_EXTRAPOLATION)
    return {int(k): f"corrections {factor[k]:.1f} times less precise than a point" for k in np.flatnonzero(lower)}
