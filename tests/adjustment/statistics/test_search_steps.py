"""The added standard deviation is found though what is asked for depends on the one in use, and jumps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from aatri.adjustment.records import Records
from aatri.adjustment.statistics.rejection import Snooping, pool_of
from aatri.adjustment.statistics.search import SETTLED, search
from aatri.arrays import Bool, Float


@dataclass(frozen=True)
class Made:
    """An adjustment without gross errors that asks for a standard deviation."""

    tau: float
    asks: Callable[[float], float]

    @property
    def test(self) -> Float:
        return np.zeros(3)

    @property
    def controlled(self) -> Bool:
        return np.ones(3, dtype=bool)

    def added_sigma(self, *, robust: bool) -> float:
        return self.asks(self.tau)


def _searched(asks: Callable[[float], float]) -> tuple[float, int, bool]:
    touches = (("strip", np.zeros(3, dtype=int)), ("point", np.arange(3)))
    rule = Snooping(4.0)
    records = Records(
        "tie", touches, lambda state, rows: (np.zeros((len(rows), 1)), ()), np.ones((3, 1)), np.ones(3, bool)
    )
    pool = pool_of(rule, [records], [np.ones(3)])
    found = search(lambda before, use, tau: Made(tau, asks), np.ones(3, dtype=bool), rule, pool)
    return found.tau, found.rounds, found.settled


@pytest.mark.parametrize("slope", [0.6, 0.0, -0.5, -0.98, -1.5])
def test_where_it_asks_for_what_is_in_use_it_ends(slope: float) -> None:
    tau, rounds, settled = _searched(lambda tau: max(1.0 + slope * (tau - 1.0), 0.0))
    assert settled
    assert tau == pytest.approx(1.0, rel=3 * SETTLED)
    assert rounds < 20


def test_at_a_jump_over_the_value_in_use_it_ends_between_the_two() -> None:
    tau, rounds, settled = _searched(lambda tau: 1.3 if tau < 1.0 else 0.8)
    assert settled
    assert tau == pytest.approx(1.0, rel=2 * SETTLED)
    assert rounds < 20


def test_one_turn_alone_is_followed_in_full() -> None:
    """As most searches go: the first adjustment, without any, asks for a little too much."""
    values = iter([1.2, 1.0, 1.0, 1.0, 1.0])
    tau, rounds, settled = _searched(lambda tau: next(values))
    assert (tau, rounds, settled) == (1.0, 3, True)
