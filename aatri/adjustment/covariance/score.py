"""What an adjustment would give for further parameters, without carrying them: one solve, no further adjustment.

Residuals v + H p depend on parameters p that were held at zero. With the whitened Jacobian A of all unknowns x, their
covariance Q (under exact constraints the constrained one) and c = A'H,

    M = H'H - c'Q c,     p = -M^-1 H'v,     C_pp = M^-1,     dx = -Q c p

which is one Gauss-Newton step of the adjustment with p from the solution without. p / sigma_p is the score test (the
multiplier of the condition p = 0): N(0, 1) where there is no such effect.

Source: Rao 1948 (score test); Kraus, Photogrammetry, on systematic errors found in residuals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.adjustment.adjusted import Adjusted
from aatri.adjustment.constraints import factorise_constrained
from aatri.adjustment.covariance.constrained import covariance_reduction
from aatri.adjustment.elimination.right_hand_sides import backward, forward, sides_of
from aatri.adjustment.records import Records, whitened
from aatri.arrays import Float, Int


@dataclass(frozen=True)
class Score:
    """Parameters that were not carried, each tried by itself.

    Attributes
    ----------
    value, sigma : (s,) float64
        Of each with the others held at zero; sigma a priori, infinite where the unknowns take up all of it.
    seen : (s,) float64
        Share of the squares of its effect on the observations that the unknowns cannot take up, 0 ... 1.
    by_value : dict of str to (n, k, s) float64
        Change of every unknown per unit of each parameter; zero for held scalars.
    """

    value: Float
    sigma: Float
    seen: Float
    by_value: dict[str, Float]


LEAST_SEEN = 1e-9
"""Below, it is rounding."""


def score(adjusted: Adjusted, records: Records, rows: Int, H: Float) -> Score:
    """Try parameters that some records depend on.

    Parameters
    ----------
    adjusted : Adjusted
        Of least squares, solved by its factor.
    records : Records
        One of the observation types of the problem, with its blocks.
    rows : (n,) int
        Those that depend on the parameters.
    H : (n, m, s) float64
        Derivative of the residuals, in units of the observation.
    """
    problem, state = adjusted.problem, adjusted.state
    v, jacobians = whitened(records, state, rows)
    H = np.where(records.active[rows, None, None], H, 0.0)
    L = records.whitener[rows]
    H = L[:, :, None] * H if L.ndim == 2 else L @ H
    size = {u.name: u.free.shape for u in problem.unknowns}
    right = {group: np.zeros((*size[group], H.shape[2])) for group, _ in records.touches}
    for (group, block), J in zip(records.touches, jacobians):
        np.add.at(right[group], block[rows], np.einsum("nmk,nms->nks", J, H))
    Qc = _covariance_times(adjusted, right)
    whole = np.einsum("nms,nms->s", H, H)
    left = whole - sum(np.einsum("nks,nks->s", right[group], Qc[group]) for group in right)
    seen = np.divide(left, whole, out=np.zeros_like(whole), where=whole > 0)
    known = seen > LEAST_SEEN
    left = np.where(known, left, 1.0)
    gradient = np.einsum("nms,nm->s", H, v)
    return Score(
        np.where(known, -gradient / left, 0.0),
        np.where(known, 1.0 / np.sqrt(left), np.inf),
        np.where(known, seen, 0.0),
        {group: -values for group, values in Qc.items()},
    )


def _covariance_times(adjusted: Adjusted, right: dict[str, Float]) -> dict[str, Float]:
    """The covariance of all unknowns times right-hand sides, by group."""
    problem, state = adjusted.problem, adjusted.state
    factored = adjusted.factored or factorise_constrained(problem, state)
    W = covariance_reduction(problem, factored, state)
    found = backward(problem, factored, state, forward(problem, factored, state, sides_of(problem, right)))
    if W:
        common = sum(np.einsum("nkc,nks->cs", W[group], values) for group, values in right.items())
        found = {group: values - W[group] @ common for group, values in found.items()}
    return found
