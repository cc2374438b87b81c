"""The search for gross errors: adjust, estimate the added variance, reject the clearest, take back what fits.

Every round adjusts once. In this order: the added standard deviation to 2 %, robust at first; the clearest rejections
(`rejection`), until what is left above the limit could not move the added standard deviation; then, with that of all
residuals, the same again to the end; last each rejected record that fits is taken back, once. It ends when nothing
changes. What is needed stays: a rejection after which the rest no longer determines the unknowns is not made, and is
told as above the limit; of several at once the clearer half is tried alone, down to one block. A robust estimate jumps,
and what it asks for may depend on the value in use so that the two alternate: what turns back twice is halved between
values too small and too large (`Steps`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Generic, Protocol, TypeVar

import numpy as np

from aatri.adjustment.statistics.rejection import Pool, Snooping, clearest, fitting, stranded
from aatri.arrays import Bool, Float, Int
from aatri.errors import GeometryError

ROUNDS = 100
SETTLED = 0.02
"""Change of the added standard deviation, as a share of it, that counts no more."""


class Solved(Protocol):
    """An adjustment with some active records, and the tests of all."""

    @property
    def test(self) -> Float:
        """Test statistics of all records, kind after kind; predicted where not active, NaN where not defined."""

    def controlled(self, rows: Int) -> Bool:
        """Whether the gross errors of some records would be known well enough to reject them, (m,)."""

    def added_sigma(self, *, robust: bool) -> float:
        """The standard deviation that the residuals ask for beyond the covariances."""


A = TypeVar("A", bound=Solved)


@dataclass(frozen=True)
class Searched(Generic[A]):
    """Result of the search."""

    solved: A
    """Adjusted with the active records and the added standard deviation."""
    active: Bool
    """(n,)."""
    tau: float
    """The added standard deviation."""
    rounds: int
    settled: bool
    """False if it was broken off."""
    above: Bool
    """(n,). Active records above the limit that the rules do not let reject, that nothing controls well, or that are
    needed."""
    first: SearchState[A] | None
    """Before the first rejection, or at the end without any: another search with less room goes the same way so far.
    None where nothing is to be kept of it."""


@dataclass(frozen=True)
class Steps:
    """Steps of the added standard deviation, with the same active records."""

    low: float = 0.0
    high: float = float("inf")
    """Largest value that was too small, smallest that was too large."""
    up: bool | None = None
    """Direction of the step before."""
    turns: int = 0
    """How often the direction has changed."""

    def after(self, tau: float, new: float) -> tuple[Steps, float]:
        """The value to go on with, the same where it is settled; `new` is what the adjustment with `reliability` asks
        for."""
        if abs(new - tau) <= SETTLED * max(new, tau):
            return self, tau
        up = new > tau
        low, high = (max(self.low, tau), self.high) if up else (self.low, min(self.high, tau))
        steps = Steps(low, high, up, self.turns + (self.up is not None and up != self.up))
        if steps.turns < 2 or high < low:
            return steps, new
        return steps, tau if high - low <= SETTLED * high else 0.5 * (low + high)


@dataclass(frozen=True)
class SearchState(Generic[A]):
    """Where a search stands that has rejected nothing yet."""

    solved: A
    tau: float = 0.0
    robust: bool = True
    """Whether the added standard deviation is estimated robustly."""
    steps: Steps = Steps()
    rounds: int = 1


def search(
    solve: Callable[[A | None, Bool, float], A],
    active: Bool,
    snooping: Snooping,
    pool: Pool,
    rejections: Callable[[A, Bool], Bool] | None = None,
    *,
    added: bool = True,
    first: SearchState[A] | None = None,
    lean: Callable[[A], A] | None = None,
) -> Searched[A]:
    """Search for gross errors.

    Parameters
    ----------
    solve : callable
        (adjustment before, active records, added standard deviation) -> adjustment.
    active : (n,) bool
        Records to begin with; the others are tested for re-admission.
    snooping, pool
        See `rejection`.
    rejections : callable, optional
        (adjustment, active records) -> what is to be rejected next; default: `rejection.clearest`.
    added : bool
        Estimate the added standard deviation; else it is zero.
    first : SearchState, optional
        Where to begin: that of a search with the same records and at least as much room.
    lean : callable, optional
        Adjustment -> the same without tests and covariances, which it makes again where it is asked for them: what is
        kept of it while the next is made, and of the first. Without it nothing is kept of the first.
    """
    if rejections is None:
        rejections = partial(clearest_controlled, snooping, pool)
    use, readmitted, needed = active.copy(), np.zeros(len(active), dtype=bool), np.zeros(len(active), dtype=bool)
    begin = first or SearchState(solve(None, use, 0.0))
    solved, tau, robust, steps, rounds = begin.solved, begin.tau, begin.robust, begin.steps, begin.rounds
    first, settled = None, False
    del begin

    def reached() -> SearchState[A] | None:
        return None if lean is None else SearchState(lean(solved), tau, robust, steps, rounds)

    while rounds < ROUNDS:
        new = solved.added_sigma(robust=robust) if added else 0.0
        before = use
        steps, better = steps.after(tau, new)
        if better != tau:
            tau = better
        elif (wrong := rejections(solved, use & ~needed) & ~needed).any() and not (
            robust and new > 0 and _negligible(snooping, solved.test, use)
        ):
            first = first or reached()
            use, steps = use & ~wrong, Steps()
        elif robust and new > 0:
            robust, steps = False, Steps()
            continue
        elif (back := ~readmitted & (fitting(snooping, solved.test, use) | stranded(pool, solved.test, use))).any():
            first = first or reached()
            use, readmitted, steps = use | back, readmitted | back, Steps()
        else:
            settled = True
            break
        rounds += 1
        solved = solved if lean is None else lean(solved)
        solved, use, stays = _next(solve, solved, before, use, tau, pool)
        needed |= stays
    above = use & (solved.test > snooping.limit)
    return Searched(solved, use, tau, rounds, settled, above, first or reached())


def _next(
    solve: Callable[[A | None, Bool, float], A], solved: A, before: Bool, use: Bool, tau: float, pool: Pool
) -> tuple[A, Bool, Bool]:
    """The next adjustment, the records in use, and those that had to stay; of rejections so many as it bears."""
    wrong = before & ~use
    while True:
        try:
            return solve(solved, use, tau), use, np.zeros_like(use)
        except GeometryError:
            if not wrong.any():
                raise
        fewer = _clearer_half(pool, solved.test, wrong)
        if not fewer.any():
            return solved, before, wrong
        use, wrong = before & ~fewer, fewer


def _negligible(snooping: Snooping, test: Float, use: Bool) -> bool:
    """Whether the records above the limit move the added standard deviation of all residuals by less than `SETTLED`."""
    above = test[use & (test > snooping.limit)]
    return float(above @ above) <= 2 * SETTLED * int(use.sum())


def _clearer_half(pool: Pool, test: Float, wrong: Bool) -> Bool:
    """The clearer half of some rejections, (n,) bool, block by block of the neighbourhood; of one block nothing."""
    rows = np.flatnonzero(wrong)
    block = pool.neighbours[rows, 0]
    blocks, number = np.unique(np.where(block >= 0, block, -1 - rows), return_inverse=True)
    largest = np.zeros(len(blocks))
    np.maximum.at(largest, number, np.nan_to_num(test[rows]))
    half = np.zeros_like(wrong)
    half[rows[np.isin(number, np.argsort(-largest, kind="stable")[: len(blocks) // 2])]] = True
    return half


def clearest_controlled(snooping: Snooping, pool: Pool, solved: Solved, use: Bool) -> Bool:
    """The clearest gross errors of an adjustment, none of records whose errors would be known badly."""
    rows = np.flatnonzero(use & (solved.test > snooping.limit))
    controlled = np.zeros(len(use), dtype=bool)
    controlled[rows] = solved.controlled(rows)
    return clearest(snooping, pool, solved.test, use, controlled)
