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
from dataclasses import dataclass, replace

import numpy as np

from aatri.adjustment.constraints.multipliers import factorise_constrained
from aatri.adjustment.covariance.constrained import covariance_reduction, covariance_times
from aatri.adjustment.elimination.effects import Effects, reduced_effects
from aatri.adjustment.elimination.factor import forward_substituted
from aatri.adjustment.elimination.right_hand_sides import forward, forward_kept, sides_of
from aatri.adjustment.records import Records, whitened
from aatri.adjustment.stepping.adjusted import Adjusted
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.arrays import Float, Int

LEAST_SEEN = 1e-6
"""Share of an effect on the observations below which what the unknowns leave of it is rounding, of Q above all."""

MOST_SIDES, ROOM_BYTES = 48, 2e7
"""Right-hand sides solved for at a time: they are as long as all unknowns; of rays, as long as those kept."""


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
    return replace(adjusted, factored=adjusted.factored or factorise_constrained(adjusted.problem, adjusted.state))


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
    sides = MOST_SIDES if ray is None else ROOM_BYTES / 8 / max(adjusted.problem.layout.n_kept, 1)
    at_a_time = max(1, int(sides) // k)
    for first in range(0, n, at_a_time):
        chunk = slice(None) if n <= at_a_time else np.flatnonzero((unit >= first) & (unit < first + at_a_time))
        here = slice(first, min(first + at_a_time, n))
        part = Score(scores.gradient[here], scores.total[here], scores.information[here])
        whitened_H = _WhitenedEffects(records, rows[chunk], H, order[chunk])
        if ray is None:
            _add_densely(part, adjusted, records, rows[chunk], whitened_H[:], unit[chunk] - first)
        else:
            _add_rays(part, adjusted, ray[order[chunk]], whitened_H, unit[chunk] - first, least_gain)
    return scores


def _rays(problem: IndexedProblem, records: Records, rows: Int) -> Int | None:
    """Places of records among the rays of eliminated blocks; None where some are not, or there are constraints."""
    if problem.rays is None or problem.rays.records is not records or problem.constraints:
        return None
    place = np.full(len(records.active), -1, dtype=np.int64)
    place[problem.rays.rows] = np.arange(len(problem.rays.rows))
    return place[rows] if (place[rows] >= 0).all() else None


def _add_rays(scores: Score, adjusted: Adjusted, ray: Int, H: Effects, unit: Int, least_gain: float) -> None:
    """Units of rays, in place."""
    problem, factored, (n, k) = adjusted.problem, adjusted.factored, scores.gradient.shape
    assert factored is not None
    sums = scores.total, scores.gradient, scores.information
    kept = reduced_effects(problem, factored, adjusted.state, ray, H, unit, sums)
    gaining = np.flatnonzero(scores.gains(range(k))[0] >= least_gain)
    if not len(gaining):
        return
    x = kept.reshape(-1, n, k)[:, gaining].reshape(-1, len(gaining) * k)
    forward_kept(problem, factored, x)
    scores.gradient[gaining] -= (x.T @ _forward_gradient(adjusted)).reshape(-1, k)
    of_unit = x.reshape(-1, len(gaining), k).transpose(1, 0, 2)
    scores.information[gaining] -= of_unit.swapaxes(1, 2) @ of_unit


def _add_densely(scores: Score, adjusted: Adjusted, records: Records, rows: Int, H: Float, unit: Int) -> None:
    """Units of any records, in place."""
    n, k = scores.gradient.shape
    v, right = _sides(adjusted, records, rows, H, unit, n)
    np.add.at(scores.gradient, unit, np.einsum("nmk,nm->nk", H, v))
    np.add.at(scores.information, unit, np.einsum("nmk,nml->nkl", H, H))
    scores.total[:] = np.einsum("ukk->uk", scores.information)
    taken_up, left = _taken_up(adjusted, right)
    scores.information[:] -= taken_up.reshape(n, k, n, k)[np.arange(n), :, np.arange(n)]
    scores.gradient[:] -= left.reshape(n, k)


def moved(adjusted: Adjusted, records: Records, rows: Int, effect: Float) -> dict[str, Float]:
    """Change of all unknowns, (n, k) by group, if residuals had an effect that was not carried; zero for held scalars.

    Parameters
    ----------
    effect : (n, m) float64
        H p, in units of the observation.
    """
    adjusted = with_factor(adjusted)
    one = np.zeros(len(rows), dtype=np.int64)
    H = _whitened_effects(records, rows, effect[:, :, None].copy())
    right = _sides(adjusted, records, rows, H, one, 1)[1]
    problem, factored, state = adjusted.problem, adjusted.factored, adjusted.state
    assert factored is not None
    product = covariance_times(problem, factored, state, covariance_reduction(problem, factored, state), right)
    return {group: -values[:, :, 0] for group, values in product.items()}


@dataclass(frozen=True)
class _WhitenedEffects:
    """Effects of which so many are whitened as are asked for at a time: those of all image points are large."""

    records: Records
    rows: Int
    """(n,). Of the records."""
    H: Effects
    order: Int
    """(n,). Row of H of each."""

    @property
    def shape(self) -> tuple[int, ...]:
        return len(self.rows), *self.H.shape[1:]

    def __getitem__(self, part: slice, /) -> Float:
        return _whitened_effects(self.records, self.rows[part], self.H[self.order[part]])


def _whitened_effects(records: Records, rows: Int, H: Float) -> Float:
    """Whitened, in the place of H where no matrices are needed; zero where a record is not active."""
    L = records.whitener[rows]
    L = np.where(records.active[rows].reshape(-1, *[1] * (L.ndim - 1)), L, 0.0)
    return np.multiply(L[:, :, None], H, out=H) if L.ndim == 2 else L @ H


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


def _taken_up(adjusted: Adjusted, right: dict[str, Float]) -> tuple[Float, Float]:
    """c'Q c and c'Q A'v of right-hand sides c, by group."""
    problem, state, factored = adjusted.problem, adjusted.state, adjusted.factored
    assert factored is not None
    u = forward(problem, factored, state, sides_of(problem, right))
    taken_up = u.gram()
    left = u.kept.T @ _forward_gradient(adjusted) + np.einsum("pam,pa->m", u.of_block, factored.block_y[u.block])
    W = covariance_reduction(problem, factored, state)
    if W:
        common = np.asarray(sum(np.einsum("nkc,nks->cs", W[group], values) for group, values in right.items()))
        taken_up = taken_up - common.T @ common
    return taken_up, left


def _forward_gradient(adjusted: Adjusted) -> Float:
    """y of the kept unknowns, (n_kept,)."""
    assert adjusted.factored is not None
    return forward_substituted(adjusted.problem.tree, adjusted.factored.y, adjusted.problem.layout.n_kept)
