"""What an adjustment would give for further parameters, without carrying them: a few solves, no further adjustment.

Residuals v + H p depend on parameters p that were held at zero. With the whitened Jacobian A of all unknowns x, their
covariance Q (under exact constraints the constrained one) and c = A'H,

    M = H'H - c'Q c,     g = H'v - c'Q A'v,     p = -M^-1 g,     C_pp = M^-1,     dx = -Q c p,     gain = g'M^-1 g

which is one Gauss-Newton step of the adjustment with p from the solution without (where A'v = 0, but for what the
iteration has left: where Q takes up nearly all of an effect, that counts). The gain, by which p would reduce
v'v, is the score test (the multiplier of the condition p = 0): chi-square of the rank of M where there is no such
effect.

Source: Rao 1948 (score test); Kraus, Photogrammetry, on systematic errors found in residuals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aatri.adjustment.adjusted import Adjusted
from aatri.adjustment.constraints import factorise_constrained
from aatri.adjustment.covariance.constrained import covariance_reduction
from aatri.adjustment.elimination.right_hand_sides import backward, forward, sides_of
from aatri.adjustment.records import Records, whitened
from aatri.arrays import Float, Int

LEAST_SEEN = 1e-6
"""Share of an effect on the observations below which what the unknowns leave of it is rounding, of Q above all."""

MOST_SIDES = 48
"""Right-hand sides solved for at a time: they are as long as all unknowns."""


@dataclass(frozen=True)
class Joint:
    """Some parameters of a unit together.

    Attributes
    ----------
    gain : float
        By which they would reduce v'v.
    rank : int
        How many of them the unknowns leave open to be seen.
    value : (k,) float64
    covariance : (k, k) float64
        A priori.
    """

    gain: float
    rank: int
    value: Float
    covariance: Float


@dataclass(frozen=True)
class Score:
    """Parameters that were not carried, unit by unit (a strip, a camera): the other units' are held at zero.

    Attributes
    ----------
    gradient, whole : (u, k) float64
        g, and the diagonal of H'H.
    information : (u, k, k) float64
        M.
    """

    gradient: Float
    whole: Float
    information: Float

    @property
    def seen(self) -> Float:
        """Share of the squares of each effect on the observations that the unknowns cannot take up, 0 ... 1, (u, k)."""
        left = np.einsum("ukk->uk", self.information)
        share = np.divide(left, self.whole, out=np.zeros_like(left), where=self.whole > 0)
        return np.where(share > LEAST_SEEN, share, 0.0)

    def joint(self, unit: int, columns: Sequence[int]) -> Joint:
        """The test of some parameters of a unit, all others held at zero."""
        some, scale = list(columns), np.sqrt(self.whole[unit])[list(columns)]
        inverse = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0)
        size, axes = np.linalg.eigh(self.information[unit][np.ix_(some, some)] * inverse[:, None] * inverse)
        seen = size > LEAST_SEEN
        axes = inverse[:, None] * axes[:, seen]
        along = axes.T @ self.gradient[unit, some]
        C = (axes / size[seen]) @ axes.T
        return Joint(float((along**2 / size[seen]).sum()), int(seen.sum()), -C @ self.gradient[unit, some], C)


def with_factor(adjusted: Adjusted) -> Adjusted:
    """The same with the factor of its normal equations, for several scores."""
    return replace(adjusted, factored=adjusted.factored or factorise_constrained(adjusted.problem, adjusted.state))


def score(adjusted: Adjusted, records: Records, rows: Int, H: Float, unit: Int | None = None) -> Score:
    """Try parameters that some records depend on.

    Parameters
    ----------
    adjusted : Adjusted
        Of least squares, solved by its factor.
    records : Records
        One of the observation types of the problem, with its blocks.
    rows : (n,) int
        Those that depend on the parameters.
    H : (n, m, k) float64
        Derivative of the residuals, in units of the observation.
    unit : (n,) int, optional
        Whose parameters those of each row are; default: all are of one.
    """
    unit = np.zeros(len(rows), dtype=np.int64) if unit is None else unit
    adjusted = with_factor(adjusted)
    n, k = int(unit.max(initial=-1)) + 1, H.shape[2]
    gradient, whole, information = np.zeros((n, k)), np.zeros((n, k)), np.zeros((n, k, k))
    at_a_time = max(1, MOST_SIDES // k)
    for first in range(0, n, at_a_time):
        some = np.flatnonzero((unit >= first) & (unit < first + at_a_time))
        units = min(at_a_time, n - first)
        v, white, right = _sides(adjusted, records, rows[some], H[some], unit[some] - first, units)
        place, here = unit[some], slice(first, first + units)
        np.add.at(gradient, place, np.einsum("nmk,nm->nk", white, v))
        np.add.at(information, place, np.einsum("nmk,nml->nkl", white, white))
        whole[here] = np.einsum("ukk->uk", information[here])
        taken_up, left = _taken_up(adjusted, right)
        information[here] -= taken_up.reshape(units, k, units, k)[np.arange(units), :, np.arange(units)]
        gradient[here] -= left.reshape(units, k)
    return Score(gradient, whole, information)


def moved(adjusted: Adjusted, records: Records, rows: Int, effect: Float) -> dict[str, Float]:
    """Change of all unknowns, (n, k) by group, if residuals had an effect that was not carried; zero for held scalars.

    Parameters
    ----------
    effect : (n, m) float64
        H p, in units of the observation.
    """
    adjusted = with_factor(adjusted)
    one = np.zeros(len(rows), dtype=np.int64)
    right = _sides(adjusted, records, rows, effect[:, :, None], one, 1)[2]
    return {group: -values[:, :, 0] for group, values in _covariance_times(adjusted, right).items()}


def _sides(
    adjusted: Adjusted, records: Records, rows: Int, H: Float, unit: Int, units: int
) -> tuple[Float, Float, dict[str, Float]]:
    """Whitened v and H, and A'H by group, (blocks, scalars, units * k)."""
    v, jacobians = whitened(records, adjusted.state, rows)
    H, k = np.where(records.active[rows, None, None], H, 0.0), H.shape[2]
    L = records.whitener[rows]
    H = L[:, :, None] * H if L.ndim == 2 else L @ H
    right: dict[str, Float] = {}
    for u in adjusted.problem.unknowns:
        for (group, block), J in zip(records.touches, jacobians):
            if group == u.name:
                found = right.setdefault(group, np.zeros((len(u.free), units, u.size, k)))
                np.add.at(found, (block[rows], unit), np.einsum("nma,nmk->nak", J, H))
    return (
        v,
        H,
        {group: found.swapaxes(1, 2).reshape(len(found), found.shape[2], units * k) for group, found in right.items()},
    )


def _taken_up(adjusted: Adjusted, right: dict[str, Float]) -> tuple[Float, Float]:
    """c'Q c and c'Q A'v of right-hand sides c, by group."""
    problem, state, factored = adjusted.problem, adjusted.state, adjusted.factored
    assert factored is not None
    u = forward(problem, factored, state, sides_of(problem, right))
    found, y = u.gram(), np.zeros(problem.layout.n_kept)
    for node, part in zip(problem.tree.nodes, factored.y):
        y[node.columns[: node.panel]] = part
    left = u.kept.T @ y + np.einsum("pam,pa->m", u.of_block, factored.block_y[u.block])
    W = covariance_reduction(problem, factored, state)
    if W:
        common = np.asarray(sum(np.einsum("nkc,nks->cs", W[group], values) for group, values in right.items()))
        found = found - common.T @ common
    return found, left


def _covariance_times(adjusted: Adjusted, right: dict[str, Float]) -> dict[str, Float]:
    """The covariance of all unknowns times right-hand sides, by group."""
    problem, state, factored = adjusted.problem, adjusted.state, adjusted.factored
    assert factored is not None
    W = covariance_reduction(problem, factored, state)
    found = backward(problem, factored, state, forward(problem, factored, state, sides_of(problem, right)))
    if W:
        common = sum(np.einsum("nkc,nks->cs", W[group], values) for group, values in right.items())
        found = {group: values - W[group] @ common for group, values in found.items()}
    return found
