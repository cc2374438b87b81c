"""Observations as records: m rows each, an m x m covariance, the blocks of unknowns they touch.

An observation type gives `evaluate(state, rows) -> v, (J, ...)`: residuals computed minus observed (n, m) and one
Jacobian (n, m, k) per touched group, both in units of the observation, for the chosen rows. The covariance enters by
its inverse Cholesky factor: `whitener @ v` has unit covariance. Rejection changes `active`. A robust `loss` weighs each
record as a whole: v and J are scaled so that J'v is the gradient of half the cost.

`compiled` is a second, faster lane an observation type may offer: `compiled(order)` prepares the records in a given
order and returns `weigh`, `weigh(whitener)` takes their whiteners, (n, m) or (n, m, m) in that order, and returns
`bind`, `bind(state)` returns `fill(first, last, v, J)`, which writes whitened residuals and Jacobians of the records
first ... last - 1, active or not, into v (n, m) and one array (n, m, k) per touched group. Both lanes agree to 1e-12.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np

from aatri.adjustment.loss import Huber
from aatri.adjustment.threads import in_threads
from aatri.adjustment.unknowns import State
from aatri.adjustment.whitening import times_whitener
from aatri.arrays import Bool, Float, Int

Evaluate = Callable[[State, Int], tuple[Float, tuple[Float, ...]]]
Evaluated = Callable[[State, Int], Float]
Fill = Callable[[int, int, Float, tuple[Float, ...]], None]
Bind = Callable[[State], Fill]
Weigh = Callable[[Float], Bind]
Compiled = Callable[[Int], Weigh]

CHUNK = 4096
"""Records at once: their Jacobians, which the lane makes too, stay in the cache."""


@runtime_checkable
class Equations(Protocol):
    """Both lanes as one object, which can be made anew for some of its rows."""

    def take(self, rows: Int) -> Equations:
        """The equations of chosen rows, numbered anew."""

    def compiled(self, order: Int) -> Weigh:
        """The compiled lane."""

    def __call__(self, state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        """Residuals and Jacobians."""


@dataclass(frozen=True)
class Records:
    """All records of one observation type."""

    name: str
    touches: tuple[tuple[str, Int], ...]
    """Name of the group of unknowns and the block each record touches."""
    evaluate: Evaluate
    """(state, rows) -> v (n, m), one J (n, m, k) per touched group."""
    whitener: Float
    """(n, m, m) or (n, m). Inverse Cholesky factor of the covariance, or inverse standard deviations of independent
    components; a zero row switches off a component that was not observed."""
    active: Bool
    """(n,)."""
    compiled: Compiled | None = None
    loss: Huber | None = None
    """What the cost of a record is if not its square."""
    linear: bool = False
    """The Jacobians do not depend on the state, and all unknowns touched are plain numbers."""
    label: Callable[[int], str] | None = None
    """Row -> what messages call the record."""
    similarity: Evaluated | None = None
    """(state, rows) -> what the records can see of the shifts, rotations and scale of a similarity (see `Unknowns`),
    projectors (n, 7, 7). Absent: what their derivatives say, which have a share that grows with the residuals where a
    shape is turned or scaled with its points."""

    normal: Callable[[State], tuple[Float, Float, float]] | None = None
    """State -> J'J, J'v and v'v of its only record of weight 1, over all that it touches, where they are known without
    a product."""

    def called(self, row: int) -> str:
        """What messages call a record."""
        return f"{self.name} row {row}" if self.label is None else f"{self.name} {self.label(row)}"

    @property
    def rows(self) -> int:
        """Residuals of one record."""
        return int(self.whitener.shape[1])

    @property
    def groups(self) -> frozenset[str]:
        """Groups of unknowns that are touched."""
        return frozenset(group for group, _ in self.touches)

    @property
    def observations(self) -> int:
        """Number of scalar observations in use."""
        used = self.observed_components()
        return int(np.count_nonzero(used if self.active.all() else used[self.active]))

    def standardised(self, state: State) -> Float:
        """Size of each record's largest whitened residual, (n,); 0 where inactive."""
        v, _ = whitened(replace(self, loss=None), state, np.arange(len(self.active)))
        return np.asarray(np.abs(v).max(axis=1))

    def observed_components(self) -> Bool:
        """Which components of each record are observed, (n, m)."""
        if self.whitener.ndim == 2:
            return np.asarray(self.whitener > 0)
        used = self.whitener[:, :, 0] != 0
        for column in range(1, self.rows):
            used |= self.whitener[:, :, column] != 0
        return np.asarray(used)

    def sigmas(self) -> Float:
        """Standard deviations a priori, (n, m); NaN where a component is not observed."""
        used = self.observed_components()
        if self.whitener.ndim == 2:
            return np.where(used, 1.0 / np.where(used, self.whitener, 1.0), np.nan)
        both = used[:, :, None] & used[:, None, :]
        inverse = np.linalg.inv(np.where(both, self.whitener, np.eye(self.rows)))
        return np.where(used, np.sqrt(np.einsum("nij,nij->ni", inverse, inverse)), np.nan)

    def take(self, rows: Int) -> Records:
        """The chosen records; equations that have a `take` of their own keep nothing of the others."""
        label, similarity = self.label, self.similarity
        evaluate, compiled = _of_rows(self.evaluate, self.compiled, rows)
        return Records(
            self.name,
            tuple((group, block[rows]) for group, block in self.touches),
            evaluate,
            self.whitener[rows],
            self.active[rows],
            compiled,
            self.loss,
            self.linear,
            None if label is None else lambda row: label(int(rows[row])),
            None if similarity is None else lambda state, chosen: similarity(state, rows[chosen]),
            self.normal,
        )

    def residuals(self, state: State) -> Float:
        """Residuals of all records, in units of the observation, (n, m)."""
        return self.evaluate(state, np.arange(len(self.active)))[0]


def _of_rows(evaluate: Evaluate, compiled: Compiled | None, rows: Int) -> tuple[Evaluate, Compiled | None]:
    """Both lanes of chosen rows."""
    if isinstance(evaluate, Equations):
        taken = evaluate.take(rows)
        return taken, None if compiled is None else taken.compiled
    of_rows = None if compiled is None else lambda order: compiled(rows[order])
    return lambda state, chosen: evaluate(state, rows[chosen]), of_rows


def keys_of(records: Sequence[Records]) -> tuple[str, ...]:
    """What tells observation types apart: their name; where several have one name (positions with and without drift),
    the name and a number, from 1, in their order: `position 1`, `position 2`.
    """
    names = [r.name for r in records]
    return tuple(
        name if names.count(name) == 1 else f"{name} {names[: k + 1].count(name)}" for k, name in enumerate(names)
    )


def whitened(records: Records, state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
    """Whitened residuals and Jacobians of some records, weighted by their loss; zero where inactive.

    Returns
    -------
    v : (n, m) float64
    jacobians : tuple of (n, m, k) float64
    """
    v, jacobians = records.evaluate(state, rows)
    active = records.active[rows]
    v = np.where(active[:, None], v, 0.0)
    jacobians = tuple(np.where(active[:, None, None], J, 0.0) for J in jacobians)
    v, jacobians = times_whitener(records.whitener[rows], v, jacobians)
    if records.loss is not None:
        records.loss.weigh(v, jacobians)
    return v, jacobians


def predicted(records: Records, state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
    """`whitened`, of inactive records too, and without their loss."""
    return times_whitener(records.whitener[rows], *records.evaluate(state, rows))


def residuals(records: Records, state: State, rows: Int) -> Float:
    """Residuals of some records, computed minus observed, in units of the observation, (n, m)."""
    n, m = len(rows), records.rows
    if records.compiled is None or n < CHUNK:
        return records.evaluate(state, rows)[0]
    widths = [J.shape[2] for J in records.evaluate(state, rows[:1])[1]]
    unit = np.ones((n, m)) if records.whitener.ndim == 2 else np.tile(np.eye(m), (n, 1, 1))
    fill, v = records.compiled(rows)(unit)(state), np.empty((n, m))

    def part(first: int, last: int) -> None:
        J = [np.empty((min(CHUNK, last - first), m, k)) for k in widths]
        for a in range(first, last, CHUNK):
            b = min(a + CHUNK, last)
            fill(a, b, v[a:b], tuple(j[: b - a] for j in J))

    in_threads(n, part)
    return v


def whitened_residuals(records: Records, state: State, rows: Int) -> Float:
    """The same in units of their standard deviations, of inactive records too."""
    return times_whitener(records.whitener[rows], residuals(records, state, rows), ())[0]


def times(records: Records, rows: Int, jacobians: tuple[Float, ...], moves: Mapping[str, Float]) -> Float:
    """Change of some records with k motions of the blocks they touch, (n, m, k): the sum of J_b G_b.

    Parameters
    ----------
    jacobians : tuple of (n, m, s) float64
        Of these rows, one for each touched group.
    moves : mapping of (n_blocks, s, k) float64
        G of every block, by group; groups that are missing stay.
    """
    parts = [J @ moves[group][block[rows]] for (group, block), J in zip(records.touches, jacobians) if group in moves]
    k = next(iter(moves.values())).shape[2]
    return np.asarray(sum(parts, np.zeros((len(rows), records.rows, k))))


def excess(records: Records, v: Float) -> float:
    """By how much the cost of some records exceeds the sum of squares of their weighted residuals."""
    return 0.0 if records.loss is None else float((records.loss.costs(v) - (v**2).sum(axis=1)).sum())


def prepared_lane(records: Records, order: Int) -> Weigh:
    """The compiled lane of the records in this order, or the same by `evaluate`."""
    if records.compiled is not None:
        return records.compiled(order)

    def weigh(whitener: Float) -> Bind:
        def bind(state: State) -> Fill:
            def fill(first: int, last: int, v: Float, J: tuple[Float, ...]) -> None:
                residuals, jacobians = times_whitener(whitener[first:last], *records.evaluate(state, order[first:last]))
                v[:] = residuals
                for target, source in zip(J, jacobians):
                    target[:] = source

            return fill

        return bind

    return weigh


def active_lane(bind: Bind, active: Bool, loss: Huber | None) -> Bind:
    """A lane weighted by the loss, and zero where not active, (n,) in the order of the lane."""
    inactive = np.flatnonzero(~active)
    if loss is None and not len(inactive):
        return bind

    def bind_active(state: State) -> Fill:
        fill = bind(state)

        def fill_active(first: int, last: int, v: Float, J: tuple[Float, ...]) -> None:
            fill(first, last, v, J)
            off = inactive[slice(*np.searchsorted(inactive, (first, last)))] - first
            for target in (v, *J) if len(off) else ():
                target[off] = 0.0  # whatever it was: an inactive record may have no finite residual
            if loss is not None:
                loss.weigh(v, J)

        return fill_active

    return bind_active
