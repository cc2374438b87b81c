"""Dense reference: the Jacobian of all unknowns as one matrix, for small problems, diagnosis and tests."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aatri.adjustment.records import Records, whitened
from aatri.adjustment.unknowns import State, Unknowns
from aatri.arrays import Float, Int


def dense_jacobian(unknowns: Sequence[Unknowns], records: Sequence[Records], state: State) -> tuple[Float, Float]:
    """Whitened Jacobian of the free unknowns, group by group, and residuals.

    Returns
    -------
    J : (m, u) float64
    v : (m,) float64
    """
    first, columns = 0, {}
    for u in unknowns:
        number = first + np.cumsum(u.free.ravel()).reshape(u.free.shape) - 1
        columns[u.name] = np.where(u.free, number, -1)
        first += int(u.free.sum())
    parts = []
    for r in records:
        v, jacobians = whitened(r, state, np.arange(len(r.active)))
        J = np.zeros((*v.shape, first + 1))
        n, m = np.indices(v.shape)
        for (group, blocks), part in zip(r.touches, jacobians):
            target = columns[group][blocks]
            for scalar in range(part.shape[2]):
                J[n, m, target[:, None, scalar]] += part[:, :, scalar]
        parts.append((J[:, :, :first].reshape(-1, first), v.ravel()))
    return np.concatenate([J for J, _ in parts]), np.concatenate([v for _, v in parts])


def constrained_reference(J: Float, v: Float, C: Float, c: Float) -> tuple[Float, Float]:
    """Step and covariance of |v + J dx|^2 least with C dx + c = 0, by the inverse of [J'J C'; C 0].

    Returns
    -------
    dx : (u,) float64
    Q : (u, u) float64
    """
    u, m = J.shape[1], len(c)
    inverse = np.linalg.inv(np.block([[J.T @ J, C.T], [C, np.zeros((m, m))]]))
    return -inverse[:u, :u] @ J.T @ v - inverse[:u, u:] @ c, inverse[:u, :u]


def free_columns(unknowns: Sequence[Unknowns]) -> dict[str, Int]:
    """Column of every free scalar in `dense_jacobian`, (n, k) per group; -1 where held."""
    first, columns = 0, {}
    for u in unknowns:
        number = first + np.cumsum(u.free.ravel()).reshape(u.free.shape) - 1
        columns[u.name] = np.where(u.free, number, -1)
        first += int(u.free.sum())
    return columns
