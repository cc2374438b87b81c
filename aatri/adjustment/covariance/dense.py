"""One step of a small linearised problem: the reduced normal equations, and their covariances, as whole matrices.

The points are eliminated one by one, as no record touches two of them. With the whitened residuals v, their derivatives
A by all other unknowns and B by a point,

    N = A'A,    g = A'v,        of every point    C = B'A,    D = B'B,    h = B'v
    S = N - sum C'D^-1 C,       dx = -S^-1 (g - sum C'D^-1 h),       of every point    dy = -D^-1 (h + C dx)
    Q = S^-1,                   Q_yx = -D^-1 C Q,                    Q_yy = D^-1 - Q_yx (D^-1 C)'

and the adjusted values of a record have the covariance A Q A' + B Q_yx A' + (B Q_yx A')' + B Q_yy B'. Nothing is
indexed, and there is no order of elimination: below some hundred unknowns beside the points that costs more than it
saves. It is the same step as `solve` takes, with the same tests; what is not determined is left to it.

Source: docs/formulas.md 6.2.
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
from aatri.arrays import Bool, Float, Int, sums_of

MOST_UNKNOWNS = 300
"""Beside those of points."""
MOST_ELEMENTS = 500_000
"""Of A. Beyond either the tree of fronts is quicker."""

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


@dataclass(frozen=True)
class _Places:
    """Where the unknowns stand in the matrices."""

    n: int
    """Columns of A."""
    column: Mapping[str, Int]
    """Of each scalar of a group, (blocks, k); n, one behind the last, where it is held."""
    group: str
    """Name of the points; empty where there are none."""
    free: Bool
    """(points + 1, k). Their free coordinates; the last row stands for no point and has none."""


@dataclass(frozen=True)
class _Design:
    """Of all records of a type: v (n, m), A (n, m, columns), B (n, m, k), and the point of each (n,)."""

    v: Float
    A: Float
    B: Float
    point: Int


def tests_of(records: Sequence[Records], state: State, covariances: Covariances) -> dict[str, RecordTests]:
    """Tests of records by key of their type, from covariances with whitened residuals."""
    each = zip(keys_of(records), records, covariances.records, covariances.whitened)
    return {key: record_tests(r, state, H, v) for key, r, H, v in each}


def is_small(unknowns: Sequence[Unknowns], records: Sequence[Records]) -> bool:
    """Whether whole matrices can be used, and are the quicker way."""
    points = {u.name for u in unknowns if u.eliminated}
    apart = len(points) <= 1 and all(sum(group in points for group, _ in r.touches) <= 1 for r in records)
    n = sum(int(u.free.sum()) for u in unknowns if not u.eliminated)
    return apart and n <= MOST_UNKNOWNS and n * sum(len(r.active) * r.rows for r in records) <= MOST_ELEMENTS


@one_blas_thread()
def solve_dense(unknowns: Sequence[Unknowns], records: Sequence[Records], state: State) -> DenseSolution | None:
    """Take one undamped step from a state; None where something is not determined.

    By one thread of BLAS: a second one does not pay, and would change the last bits.

    Parameters
    ----------
    unknowns : sequence of Unknowns
        Of which one group at most is eliminated: the points.
    records : sequence of Records
        Without loss; none touches two points.
    state : mapping
        Where to linearise.
    """
    free = {u.name: u.free & _taking_part(u, records)[:, None] for u in unknowns}
    out = {u.name: np.asarray((u.free & ~free[u.name]).any(axis=1)) for u in unknowns}
    places = _places(free, next((u.name for u in unknowns if u.eliminated), ""))
    design = [_design(r, state, places) for r in records]
    N, C, D, g, h = _normal_equations(records, design, places)
    try:
        D_inverse = np.where(places.free[:, :, None], _inverse(D, np.einsum("pkk->pk", D)), 0.0)
        by_column = D_inverse @ C
        S = N - np.einsum("pki,pkj->ij", C, by_column)
        Q = _inverse(S[None], np.diag(N)[None])[0]
    except np.linalg.LinAlgError:
        return None
    if not (np.isfinite(g).all() and np.isfinite(h).all()):
        return None
    dx = -Q @ (g - np.einsum("pki,pk->i", by_column, h))
    dy = -np.einsum("pkl,pl->pk", D_inverse, h + C @ dx)
    Q_yx = -by_column @ Q
    Q_yy = D_inverse - Q_yx @ by_column.swapaxes(1, 2)
    steps = {name: np.append(dx, 0.0)[column] for name, column in places.column.items()}
    after = retract_state(unknowns, state, {**steps, **({places.group: dy[:-1]} if places.group else {})})
    departure, whitened, of_records = 0.0, [], []
    for r, d in zip(records, design):
        linear = d.v + d.A @ dx + np.einsum("nmk,nk->nm", d.B, dy[d.point])
        now = _Design(linear, d.A, d.B, d.point) if r.linear else _design(r, after, places)
        departure = max(departure, float(np.abs(linear - now.v)[r.active].max(initial=0.0)))
        of_both = now.B @ Q_yx[now.point] @ now.A.swapaxes(1, 2)
        H = now.A @ Q @ now.A.swapaxes(1, 2) + of_both + of_both.swapaxes(1, 2)
        H += now.B @ Q_yy[now.point] @ now.B.swapaxes(1, 2)
        for group, block in r.touches:
            H[out[group][block]] = np.nan
        whitened.append(now.v)
        of_records.append(H)
    wide = np.pad(Q, (0, 1))
    groups = {name: wide[column[:, :, None], column[:, None, :]] for name, column in places.column.items()}
    groups |= {places.group: Q_yy[:-1]} if places.group else {}
    for name, lacking in out.items():
        groups[name][lacking] = np.nan
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


def _places(free: Mapping[str, Bool], points: str) -> _Places:
    columns, n = {}, 0
    for name, f in free.items():
        if name != points:
            columns[name] = n + np.cumsum(f).reshape(f.shape) - 1
            n += int(f.sum())
    columns = {name: np.where(free[name], column, n) for name, column in columns.items()}
    return _Places(n, columns, points, np.pad(free.get(points, np.zeros((0, 1), dtype=bool)), ((0, 1), (0, 0))))


def _design(r: Records, state: State, places: _Places) -> _Design:
    rows, (last, k) = np.arange(len(r.active)), np.array(places.free.shape) - [1, 0]
    v, jacobians = predicted(r, state, rows)
    A, B, point = (
        np.zeros((len(rows), r.rows, places.n + 1)),
        np.zeros((len(rows), r.rows, k)),
        np.full(len(rows), last),
    )
    for (group, block), J in zip(r.touches, jacobians):
        if group == places.group:
            B, point = np.where(places.free[block][:, None], J, 0.0), block
        else:
            A[rows[:, None], :, places.column[group][block]] += J.swapaxes(1, 2)
    return _Design(v, A[:, :, : places.n], B, point)


def _normal_equations(
    records: Sequence[Records], design: Sequence[_Design], places: _Places
) -> tuple[Float, Float, Float, Float, Float]:
    """N, C, D, g and h of the active records; D is 1 where a coordinate is held."""
    n, (points, k) = places.n, places.free.shape
    N, C, D = np.zeros((n, n)), np.zeros((points, k, n)), ~places.free[:, :, None] * np.eye(k)
    g, h = np.zeros(n), np.zeros((points, k))
    for r, d in zip(records, design):
        v, A, B, point = d.v[r.active], d.A[r.active], d.B[r.active], d.point[r.active]
        N += np.einsum("nmi,nmj->ij", A, A, optimize=True)
        g += np.einsum("nmi,nm->i", A, v)
        Bt = B.swapaxes(1, 2)
        C, D = C + sums_of(Bt @ A, point, points), D + sums_of(Bt @ B, point, points)
        h += sums_of(np.einsum("nmk,nm->nk", B, v), point, points)
    return N, C, D, g, h


def _inverse(matrix: Float, diagonal: Float) -> Float:
    """Inverses of normal equations, (n, m, m), by the diagonal (n, m) that they had before anything was eliminated.

    Raises
    ------
    numpy.linalg.LinAlgError
        If something is not determined.
    """
    if not (diagonal > 0).all():
        raise np.linalg.LinAlgError("nothing observes an unknown")
    scale = 1.0 / np.sqrt(diagonal)
    scaled = matrix * scale[:, :, None] * scale[:, None, :]
    T = np.linalg.inv(np.linalg.cholesky(scaled))
    if (np.einsum("nii->ni", T) ** -2.0 < VANISHING).any():
        raise np.linalg.LinAlgError("rounding decides an unknown")
    T = T * scale[:, None, :]
    return np.asarray(T.swapaxes(1, 2) @ T)
