"""What an adjustment would give for further parameters, without carrying them: a few solves, no further adjustment.

Residuals v + H p depend on parameters p that were held at zero. With the whitened Jacobian A of all unknowns x, their
covariance Q (under exact constraints the constrained one) and c = A'H,

    M = H'H - c'Q c,     g = H'v - c'Q A'v,     p = -M^-1 g,     C_pp = M^-1,     dx = -Q c p,     gain = g'M^-1 g

which is one Gauss-Newton step of the adjustment with p from the solution without (where A'v = 0, but for what the
iteration has left: where Q takes up nearly all of an effect, that counts). The gain, by which p would reduce
v'v, is the score test (the multiplier of the condition p = 0): chi-square of the rank of M where there is no such
effect.

Of many units on rays only those need be solved for that could matter: with M of the eliminated blocks alone, the kept
unknowns held, the gain is less than the true one.

Source: Rao 1948 (score test); Kraus, Photogrammetry, on systematic errors found in residuals.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.sparse import csr_array, hstack

from aatri.adjustment.covariance.constrained import covariance_reduction, covariance_times
from aatri.adjustment.elimination.effects import (
    Effects,
    WhitenedEffects,
    reduced_effects,
    unit_products,
    whitened_effects,
)
from aatri.adjustment.elimination.right_hand_sides import sides_of, without_blocks
from aatri.adjustment.records import Records, whitened
from aatri.adjustment.stepping.adjusted import Adjusted, factor_of
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.threads import one_blas_thread, run_all
from aatri.arrays import Float, Int

LEAST_SEEN = 1e-6
"""Share of an effect on the observations below which what the unknowns leave of it is rounding, of Q above all."""

ROOM_BYTES, MOST_AT_ONCE = 1e8, 4
"""Of right-hand sides that a thread makes at a time, and threads that do; then what is not zero is kept of them."""


@dataclass(frozen=True)
class Joint:
    """Some parameters of a unit together."""

    gain: float
    """By which they would reduce v'v."""
    rank: int
    """How many of them the unknowns leave open to be seen."""
    value: Float
    """(k,)."""
    covariance: Float
    """(k, k). A priori."""


@dataclass(frozen=True)
class Score:
    """Parameters that were not carried, unit by unit (a strip, a camera): the other units' are held at zero."""

    gradient: Float
    total: Float
    """(u, k). g, and the diagonal of H'H."""
    information: Float
    """(u, k, k). M."""

    @property
    def seen(self) -> Float:
        """Share of the squares of each effect on the observations that the unknowns cannot take up, 0 ... 1, (u, k)."""
        left = np.einsum("ukk->uk", self.information)
        share = np.divide(left, self.total, out=np.zeros_like(left), where=self.total > 0)
        return np.where(share > LEAST_SEEN, share, 0.0)

    def joint(self, unit: int, columns: Sequence[int]) -> Joint:
        """The test of some parameters of a unit, all others held at zero."""
        tested = list(columns)
        size, axes = (part[0] for part in self._axes(columns, slice(unit, unit + 1)))
        seen = size > LEAST_SEEN
        axes = axes[:, seen]
        along = axes.T @ self.gradient[unit, tested]
        C = (axes / size[seen]) @ axes.T
        return Joint(float((along**2 / size[seen]).sum()), int(seen.sum()), -C @ self.gradient[unit, tested], C)

    def gains(self, columns: Sequence[int]) -> tuple[Float, Int]:
        """Gain and rank of some parameters of each unit, all others held at zero, (u,) both."""
        size, axes = self._axes(columns, slice(None))
        seen = size > LEAST_SEEN
        along = np.einsum("uka,uk->ua", axes, self.gradient[:, list(columns)])
        return (np.where(seen, along**2, 0.0) / np.where(seen, size, 1.0)).sum(axis=1), seen.sum(axis=1)

    def _axes(self, columns: Sequence[int], units: slice) -> tuple[Float, Float]:
        """Shares of directions that the unknowns cannot take up, and these directions, (u, k), (u, k, k)."""
        tested, scale = list(columns), np.sqrt(self.total[units][:, list(columns)])
        inverse = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0)
        M = self.information[units][:, tested][:, :, tested] * inverse[:, :, None] * inverse[:, None, :]
        size, axes = np.linalg.eigh(M)
        return size, inverse[:, :, None] * axes


def with_factor(adjusted: Adjusted) -> Adjusted:
    """The same with the factor of its normal equations, for several scores."""
    return replace(adjusted, factored=factor_of(adjusted))


def score(
    adjusted: Adjusted, records: Records, rows: Int, H: Effects, unit: Int | None = None, least_gain: float = 0.0
) -> Score:
    """Try parameters that some records depend on.

    Parameters
    ----------
    adjusted : Adjusted
        Of least squares, solved by its factor.
    records : Records
        One of the observation types of the problem, with its blocks.
    rows : (n,) int
        Those that depend on the parameters.
    H : (n, m, k) float64, or what makes them
        Derivative of the residuals, in units of the observation.
    unit : (n,) int, optional
        Whose parameters those of each row are; default: all are of one.
    least_gain : float
        A unit whose gain with the kept unknowns held is less may get that gain.
    """
    unit = np.zeros(len(rows), dtype=np.int64) if unit is None else unit
    adjusted = with_factor(adjusted)
    n, k = int(unit.max(initial=-1)) + 1, H.shape[2]
    scores = Score(np.zeros((n, k)), np.zeros((n, k)), np.zeros((n, k, k)))
    ray = _rays(adjusted.problem, records, rows)
    order = np.arange(len(rows)) if ray is None else np.argsort(ray, kind="stable")
    rows, unit = rows[order], unit[order]
    at_a_time = max(1, int(ROOM_BYTES / 8 / _length(adjusted.problem, records, by_rays=ray is not None)) // k)
    firsts = range(0, n, at_a_time)
    kept: list[tuple[Int, csr_array]] = [(np.zeros(0, dtype=np.int64), csr_array((0, 0)))] * len(firsts)
    W = {} if ray is not None else _constraint_reduction(adjusted)
    by_constraints = np.zeros_like(scores.information)  # which leave more to be seen

    def add(number: int) -> None:
        """Some units, which share nothing with others."""
        first = firsts[number]
        chunk = slice(None) if n <= at_a_time else np.flatnonzero((unit >= first) & (unit < first + at_a_time))
        here = slice(first, min(first + at_a_time, n))
        part = Score(scores.gradient[here], scores.total[here], scores.information[here])
        whitened_H = WhitenedEffects(records, rows[chunk], H, order[chunk])
        if ray is None:
            right, groups = _add_records(part, adjusted, records, rows[chunk], whitened_H[:], unit[chunk] - first)
            by_constraints[here] = _by_constraints(W, groups, *part.gradient.shape)
        else:
            right = _add_rays(part, adjusted, ray[order[chunk]], whitened_H, unit[chunk] - first)
        gaining = np.flatnonzero(part.gains(range(k))[0] >= least_gain)
        sides = _nonzero(right)
        few = sides[:, (gaining[:, None] * k + np.arange(k)).ravel()] if len(gaining) < len(part.total) else sides
        kept[number] = first + gaining, few

    if ray is not None:
        _ = adjusted.problem.ray_lane, adjusted.problem.ray_columns  # made once, not by each thread
    with one_blas_thread(), ThreadPoolExecutor(min(adjusted.problem.threads, MOST_AT_ONCE)) as pool:
        run_all(pool, [partial(add, number) for number in range(len(firsts))])
    if n:
        gaining_units, sides = zip(*kept)
        _subtract_taken_up(scores, adjusted, np.concatenate(gaining_units), hstack(sides, format="csr"))
    scores.information[:] += by_constraints
    return scores


def _rays(problem: IndexedProblem, records: Records, rows: Int) -> Int | None:
    """Places of records among the rays of eliminated blocks; None where some are not, or there are constraints."""
    if problem.rays is None or problem.rays.records is not records or problem.constraints:
        return None
    place = np.full(len(records.active), -1, dtype=np.int64)
    place[problem.rays.rows] = np.arange(len(problem.rays.rows))
    return place[rows] if (place[rows] >= 0).all() else None


def _nonzero(right: Float) -> csr_array:
    """Sparse right-hand sides of dense ones; what scipy makes of an array goes through it five times."""
    place = np.flatnonzero(right)
    row, column = np.divmod(place, right.shape[1])
    return csr_array((right.ravel()[place], column, np.searchsorted(row, np.arange(len(right) + 1))), shape=right.shape)


def _length(problem: IndexedProblem, records: Records, *, by_rays: bool) -> int:
    """Of a right-hand side as it is made: the kept unknowns, of records other than rays also all that they touch."""
    touched = {group for group, _ in records.touches} if not by_rays else set()
    return max(1, problem.layout.n_kept, sum(u.free.size for u in problem.unknowns if u.name in touched))


def _add_rays(scores: Score, adjusted: Adjusted, ray: Int, H: Effects, unit: Int) -> Float:
    """Units of rays with the kept unknowns held, in place; returned are the right-hand sides of those."""
    assert adjusted.factored is not None
    sums = scores.total, scores.gradient, scores.information
    return reduced_effects(adjusted.problem, adjusted.factored, adjusted.state, ray, H, unit, sums)


def _add_records(
    scores: Score, adjusted: Adjusted, records: Records, rows: Int, H: Float, unit: Int
) -> tuple[Float, dict[str, Float]]:
    """The same of any records, without the part of the eliminated blocks; and A'H by group."""
    n, k = scores.gradient.shape
    v, groups = _sides(adjusted, records, rows, H, unit, n)
    np.add.at(scores.gradient, unit, np.einsum("nmk,nm->nk", H, v))
    np.add.at(scores.information, unit, np.einsum("nmk,nml->nkl", H, H))
    scores.total[:] = np.einsum("ukk->uk", scores.information)
    problem, state, factored = adjusted.problem, adjusted.state, adjusted.factored
    assert factored is not None
    right = sides_of(problem, groups)
    kept, of_block = without_blocks(problem, factored, state, right)
    inner = of_block.reshape(-1, n, k).transpose(1, 2, 0)
    scores.information[:] -= inner @ inner.swapaxes(1, 2)
    scores.gradient[:] -= (of_block.reshape(-1, n * k).T @ factored.block_y[right.block].ravel()).reshape(n, k)
    return kept, groups


def _constraint_reduction(adjusted: Adjusted) -> dict[str, Float]:
    """W by group, by which exact constraints reduce the covariances; empty without any."""
    assert adjusted.factored is not None
    return covariance_reduction(adjusted.problem, adjusted.factored, adjusted.state)


def _by_constraints(W: dict[str, Float], groups: dict[str, Float], n: int, k: int) -> Float:
    """c'W W'c of each unit, (n, k, k): what exact constraints keep the unknowns from taking up."""
    if not W:
        return np.zeros((n, k, k))
    by_unit = sum(np.einsum("nkc,nks->sc", W[group], values) for group, values in groups.items())
    common: Float = np.asarray(by_unit).reshape(n, k, -1)
    return np.asarray(common @ common.swapaxes(1, 2))


def _subtract_taken_up(scores: Score, adjusted: Adjusted, gaining: Int, right: csr_array) -> None:
    """What the kept unknowns take up, of the units that may gain enough, which have the right-hand sides."""
    k, factored = scores.gradient.shape[1], adjusted.factored
    assert factored is not None
    at_a_time = max(1, int(ROOM_BYTES / 8 / max(adjusted.problem.tree.largest_front, 1)) // k)
    for first in range(0, len(gaining), at_a_time):  # all meet in the last front
        units = gaining[first : first + at_a_time]
        of_units = right if len(units) == len(gaining) else right[:, first * k : (first + len(units)) * k]
        squares, products = unit_products(adjusted.problem, factored, of_units, k)
        scores.information[units] -= squares
        scores.gradient[units] -= products


def moved(adjusted: Adjusted, records: Records, rows: Int, effect: Float) -> dict[str, Float]:
    """Change of all unknowns, (n, k) by group, if residuals had an effect that was not carried; zero for held scalars.

    Parameters
    ----------
    effect : (n, m) float64
        H p, in units of the observation.
    """
    adjusted = with_factor(adjusted)
    one = np.zeros(len(rows), dtype=np.int64)
    H = whitened_effects(records, rows, effect[:, :, None].copy())
    right = _sides(adjusted, records, rows, H, one, 1)[1]
    problem, factored, state = adjusted.problem, adjusted.factored, adjusted.state
    assert factored is not None
    product = covariance_times(problem, factored, state, covariance_reduction(problem, factored, state), right)
    return {group: -values[:, :, 0] for group, values in product.items()}


def _sides(
    adjusted: Adjusted, records: Records, rows: Int, H: Float, unit: Int, units: int
) -> tuple[Float, dict[str, Float]]:
    """Whitened v, and A'H by group, (blocks, scalars, units * k), of whitened H."""
    v, jacobians = whitened(records, adjusted.state, rows)
    k = H.shape[2]
    right: dict[str, Float] = {}
    for u in adjusted.problem.unknowns:
        for (group, block), J in zip(records.touches, jacobians):
            if group == u.name:
                side = right.setdefault(group, np.zeros((len(u.free), units, u.size, k)))
                np.add.at(side, (block[rows], unit), np.einsum("nma,nmk->nak", J, H))
    return (
        v,
        {group: side.swapaxes(1, 2).reshape(len(side), side.shape[2], units * k) for group, side in right.items()},
    )
