"""Weights beyond reach of double precision are lowered, all others left as they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.adjustment.openness.limits import BEYOND, WITHIN
from aatri.adjustment.openness.reach import scaled, within_reach
from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State
from aatri.arrays import Float, Int


def _sums(name: str, a: list[int], b: list[int], weight: list[float]) -> Records:
    """Observations of the sum of the first scalars of two blocks."""

    def evaluate(_state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        J = np.tile([[1.0, 0.0, 0.0]], (len(rows), 1, 1))
        return np.zeros((len(rows), 1)), (J, J)

    touches = (("point", np.array(a, dtype=np.int32)), ("point", np.array(b, dtype=np.int32)))
    return Records(name, touches, evaluate, np.sqrt(weight)[:, None], np.ones(len(a), dtype=bool))


def test_a_weight_beyond_reach_of_the_sum_of_all_smaller_ones_is_brought_within() -> None:
    others = _sums("others", [0, 0, 1], [2, 3, 3], [2.0, 3.0, 5.0])
    strict = _sums("strict", [0], [1], [1e14])
    factors = within_reach([others, strict], [0, 1], {})
    assert list(factors) == [1]
    after = scaled(strict, factors[1]).whitener[0, 0] ** 2
    assert after == pytest.approx(WITHIN * 5.0)  # both ends: 2 + 3 and 5


def test_nothing_is_changed_within_reach_or_where_nothing_else_is_there() -> None:
    others = _sums("others", [0, 0], [1, 2], [1.0, 1e-9 * BEYOND])
    assert within_reach([others], [0], {}) == {}
    alone = _sums("alone", [4, 5], [6, 7], [1e30, 1.0])
    assert within_reach([alone], [0], {}) == {}


def test_where_the_accurate_ones_determine_a_block_alone_nothing_is_lost() -> None:
    weak = _sums("weak", [0], [9], [1e-4])
    strong = _sums("strong", [0, 0, 0], [1, 2, 3], [1e8, 1e8, 1e8])
    assert within_reach([weak, strong], [0, 1], {}) == {}


def test_candidates_that_are_all_inactive_change_nothing() -> None:
    """What is left of distances of a group when all of them are members of correlated records: their unknowns."""
    gone = replace(_sums("gone", [0], [1], [1e14]), active=np.zeros(1, dtype=bool))
    others = _sums("others", [0, 2], [3, 3], [2.0, 3.0])
    assert within_reach([others, gone], [0, 1], {}) == {}
    assert within_reach([gone], [0], {}) == {}
