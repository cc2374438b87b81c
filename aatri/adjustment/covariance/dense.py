"""One step of a small linearised problem: normal equations and covariances as whole matrices.

    N = A'A,    dx = -N^-1 A'v,    Q = N^-1,    covariance of the adjusted values H = A Q A'

of whitened records. Nothing is indexed, and there is no order of elimination: below some hundred unknowns that costs
more than it saves. It is the same step as `solve` takes, with the same tests; what is not determined is left to it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from aatri.adjustment.covariance.marginal import Covariances
from aatri.adjustment.records import Records, keys_of, predicted
from aatri.adjustment.statistics.record_tests import RecordTests, record_tests
from aatri.adjustment.threads import one_blas_thread
from aatri.adjustment.unknowns import State, Unknowns, retract_state
from aatri.arrays import Bool, Float, Int

MOST_UNKNOWNS = 300
MOST_ELEMENTS = 500_000
"""Of the whitened design matrix. Beyond either the tree of fronts is quicker."""

VANISHING = 1e-10
"""A pivot of the normal equations scaled to unit diagonal, below which rounding decides (docs/adjustment.md)."""


@dataclass(frozen=True)
class DenseSolution:
    """A solved small problem; see `LinearSolution`."""

    state: dict[str, Any]
    """After the step."""
    records: tuple[Records, ...]
    departure: float
    """Largest difference of a residual from the linear model, in its standard deviations."""
    covariances: Covariances
    """Marginal covariances, a priori."""

    def tests(self) -> dict[str, RecordTests]:
        """Tests of all records by key of their type, predicted where not active."""
        return tests_of(self.records, self.state, self.covariances)


def tests_of(records: Sequence[Records], state: State, covariances: Covariances) -> dict[str, RecordTests]:
    """Tests of records by key of their type, from covariances with whitened residuals."""
    each = zip(keys_of(records), records, covariances.records, covariances.whitened)
    return {key: record_tests(r, state, H, v) for key, r, H, v in each}


def is_small(unknowns: Sequence[Unknowns], records: Sequence[Records]) -> bool:
    """Whether whole matrices are the quicker way."""
    n = sum(int(u.free.sum()) for u in unknowns)
    return n <= MOST_UNKNOWNS and n * sum(len(r.active) * r.rows for r in records) <= MOST_ELEMENTS


@one_blas_thread()
def solve_dense(unknowns: Sequence[Unknowns], records: Sequence[Records], state: State) -> DenseSolution | None:
    """Take one undamped step from a state; None where something is not determined.

    By one thread of BLAS: a second one does not pay, and would change the last bits.

    Parameters
    ----------
    unknowns : sequence of Unknowns
    records : sequence of Records
        Without loss.
    state : mapping
        Where to linearise.
    """
    free = {u.name: u.free & _taking_part(u, records)[:, None] for u in unknowns}
    out = {u.name: np.asarray((u.free & ~free[u.name]).any(axis=1)) for u in unknowns}
    column = _columns(free)
    n = sum(int(f.sum()) for f in free.values())
    design = [_design(r, state, column, n) for r in records]
    N, g = np.zeros((n, n)), np.zeros(n)
    for r, (v, A) in zip(records, design):
        used = A[r.active].reshape(-1, n)
        N, g = N + used.T @ used, g + used.T @ v[r.active].ravel()
    diagonal = np.diag(N)
    if not (np.isfinite(g).all() and (diagonal > 0).all()):
        return None
    scale = 1.0 / np.sqrt(diagonal)
    try:
        L = np.linalg.cholesky(N * scale[:, None] * scale)
    except np.linalg.LinAlgError:
        return None
    if (np.diag(L) ** 2 < VANISHING).any():
        return None
    inverse = np.linalg.inv(L) * scale
    Q = inverse.T @ inverse
    dx = np.append(-Q @ g, 0.0)
    after = retract_state(unknowns, state, {name: dx[c] for name, c in column.items()})
    departure, whitened, of_records = 0.0, [], []
    for r, (v, A) in zip(records, design):
        now = (v + A @ dx[:-1], A) if r.linear else _design(r, after, column, n)
        departure = max(departure, float(np.abs(v + A @ dx[:-1] - now[0])[r.active].max(initial=0.0)))
        H = now[1] @ Q @ now[1].swapaxes(1, 2)
        for group, block in r.touches:
            H[out[group][block]] = np.nan
        whitened.append(now[0])
        of_records.append(H)
    wide = np.pad(Q, (0, 1))
    groups = {name: wide[c[:, :, None], c[:, None, :]] for name, c in column.items()}
    for name, alone in out.items():
        groups[name][alone] = np.nan
    marginal = Covariances(groups, np.zeros((0, 0, 0)), tuple(of_records), whitened=tuple(whitened))
    return DenseSolution(after, tuple(records), departure, marginal)


def _taking_part(u: Unknowns, records: Sequence[Records]) -> Bool:
    """Blocks that take part, (n,): of the eliminated group not those that inactive records alone touch."""
    touched, active = np.zeros(len(u.free), dtype=bool), np.zeros(len(u.free), dtype=bool)
    for r in records if u.eliminated else ():
        for block in (block for group, block in r.touches if group == u.name):
            touched[block] = True
            active[block[r.active]] = True
    return np.asarray(active | ~touched)


def _columns(free: Mapping[str, Bool]) -> dict[str, Int]:
    """Column of each scalar, (n, k) of each group; -1, the last, where it is held."""
    columns, first = {}, 0
    for name, f in free.items():
        columns[name] = np.where(f, first + np.cumsum(f).reshape(f.shape) - 1, -1)
        first += int(f.sum())
    return columns


def _design(r: Records, state: State, column: Mapping[str, Int], n: int) -> tuple[Float, Float]:
    """Whitened residuals (n_records, m) and design matrix (n_records, m, n) of all records."""
    rows = np.arange(len(r.active))
    v, jacobians = predicted(r, state, rows)
    A = np.zeros((len(rows), r.rows, n + 1))
    for (group, block), J in zip(r.touches, jacobians):
        A[rows[:, None], :, column[group][block]] += J.swapaxes(1, 2)
    return v, A[:, :, :n]
