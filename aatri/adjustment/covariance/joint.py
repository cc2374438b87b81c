"""Covariance of many blocks of one group with each other, as one matrix.

With x = W y + e, y the kept unknowns and W the weights with which eliminated blocks follow them (nothing but a pick of
columns for blocks that are kept),

    Q = W Q_yy W' + diag(D^-1),    Q_yy W' = N^-1 W' by one solve with many right-hand sides,

D the normal matrix of an eliminated block's own observations. Constraints and inner constraints of a free datum take
their share off, see `constrained` and `s_transformation`.
"""

from __future__ import annotations

import numpy as np

from aatri.adjustment.covariance.constrained import covariance_reduction
from aatri.adjustment.covariance.cross import rows_in_kept
from aatri.adjustment.covariance.s_transformation import STransformation
from aatri.adjustment.elimination.backsolve import solve_columns
from aatri.adjustment.elimination.fronts import factorise
from aatri.adjustment.stepping.adjusted import Adjusted
from aatri.adjustment.stepping.robust import refuse_covariances
from aatri.arrays import Float, Int


def joint_covariance(adjusted: Adjusted, group: str, blocks: Int, free_datum: STransformation | None = None) -> Float:
    """Covariance matrix of some blocks of a group of unknowns, a priori (sigma0 = 1).

    Parameters
    ----------
    adjusted : Adjusted
    group : str
    blocks : (m,) int
        Numbers of blocks, each once.
    free_datum : STransformation, optional
        To the inner constraints of a free datum.

    Returns
    -------
    (m k, m k) float64
        Zero for held scalars; its diagonal blocks are the marginal covariances.
    """
    refuse_covariances(adjusted.down_weighted)
    problem = adjusted.problem
    factored = adjusted.factored or factorise(problem, adjusted.state)
    size = next(u.size for u in problem.unknowns if u.name == group)
    W, own = np.zeros((problem.layout.n_kept, len(blocks) * size)), np.zeros((len(blocks), size, size))
    for i, block in enumerate(blocks.tolist()):
        columns, weights, own[i] = rows_in_kept(adjusted, factored, (group, block))
        there = columns >= 0
        np.add.at(W[:, size * i : size * (i + 1)], columns[there], weights.T[there])
    Q = W.T @ solve_columns(problem, factored, W)
    for i in range(len(blocks)):
        Q[size * i : size * (i + 1), size * i : size * (i + 1)] += own[i]
    constrained = covariance_reduction(problem, factored, adjusted.state)
    if constrained:
        w = constrained[group][blocks].reshape(len(Q), -1)
        Q -= w @ w.T
    if free_datum is not None and group in free_datum.H:
        H, Z = (part[group][blocks].reshape(len(Q), -1) for part in (free_datum.H, free_datum.Z))
        mixed = H @ free_datum.M @ Z.T
        Q += H @ free_datum.inner @ H.T - mixed - mixed.T
    return np.asarray((Q + Q.T) / 2)
