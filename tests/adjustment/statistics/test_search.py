"""The search for gross errors, and the steps of the added variance."""

from __future__ import annotations

import gc
import tracemalloc
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest

from aatri.adjustment.records import Records
from aatri.adjustment.statistics import variance_components
from aatri.adjustment.statistics.rejection import Pool, Snooping, clearest, fitting, pool_of, stranded
from aatri.adjustment.statistics.search import SETTLED, search
from aatri.adjustment.statistics.variance_components import common_sigma
from aatri.adjustment.whitening import inverse_cholesky
from aatri.arrays import Bool, Float, Int
from aatri.errors import GeometryError

# Rules of rejection and re-admission, tests of records, the added standard deviation.

RNG = np.random.default_rng(3)


def _records(name: str, n: int, **touches):
    groups = tuple((group, np.asarray(block)) for group, block in touches.items())
    return Records(name, groups, lambda state, rows: (np.zeros((len(rows), 1)), ()), np.ones((n, 1)), np.ones(n, bool))


def _pool(rule=None, ties=20, controls=4, strips=2):
    """Each point once in every strip; control at the first points."""
    point = np.tile(np.arange(ties // strips), strips)
    strip = np.repeat(np.arange(strips), ties // strips)
    kinds = [_records("tie", ties, strip=strip, point=point), _records("control", controls, point=np.arange(controls))]
    return pool_of(rule or Snooping(4.0), kinds, [np.ones(ties), np.ones(controls)])


def test_of_small_matrices_the_inverse_factor_is_that_of_numpy() -> None:
    root = RNG.normal(size=(50, 3, 3))
    C = root @ root.swapaxes(1, 2) + 0.1 * np.eye(3)
    np.testing.assert_allclose(inverse_cholesky(C), np.linalg.inv(np.linalg.cholesky(C)), rtol=1e-9, atol=1e-12)
    with pytest.raises(np.linalg.LinAlgError):
        inverse_cholesky(-C)


def test_of_two_records_of_a_point_one_is_rejected_control_before_a_strip() -> None:
    test = np.zeros(24)
    test[[2, 12, 22]] = 9.0  # point 2 in both strips, and its control
    pool = _pool()
    assert np.flatnonzero(clearest(Snooping(4.0, most=1.0), pool, test, np.ones(24, bool))).tolist() == [22]


def test_only_the_clearest_are_rejected_and_few_of_one_strip() -> None:
    test = np.full(24, 5.0)
    test[20:] = 0.0
    rule = Snooping(4.0, most=1.0)
    wrong = clearest(rule, _pool(), test, np.ones(24, bool))
    assert np.bincount(np.repeat([0, 1], 10), wrong[:20]).tolist() == [2, 2]  # 15 % of ten, rounded up
    test[3] = 100.0
    assert np.flatnonzero(clearest(rule, _pool(), test, np.ones(24, bool))).tolist() == [3]
    assert clearest(rule, _pool(), test, np.ones(24, bool), controlled=test < 50).sum() == 4


def test_a_record_without_a_test_is_never_rejected() -> None:
    test = np.full(24, np.nan)
    assert not clearest(Snooping(4.0), _pool(), test, np.ones(24, bool)).any()


def test_the_last_tie_of_a_point_is_not_rejected_in_place_of_its_control() -> None:
    active, test = np.ones(24, bool), np.zeros(24)
    active[[12, 20]] = False  # the other strip of point 2; all control that may be
    test[[2, 22]] = 9.0
    assert not clearest(Snooping(4.0), _pool(), test, active).any()


def test_what_fits_comes_back_and_what_was_rejected_without_a_test_too() -> None:
    active, test = np.ones(24, bool), np.full(24, 1.0)
    active[[0, 1, 2, 12]] = False
    test[[1]] = 7.0
    test[[2, 12, 22]] = np.nan  # nothing ties point 2 any more: its control is not tested either
    pool = _pool()
    assert np.flatnonzero(fitting(Snooping(4.0), test, active)).tolist() == [0]
    assert np.flatnonzero(stranded(pool, test, active)).tolist() == [2]


def test_the_added_standard_deviation_is_found_and_zero_where_none_is_needed() -> None:
    n, tau = 4000, 0.3
    values = RNG.uniform(0.01, 0.2, (n, 3)) ** 2
    v = RNG.normal(size=(n, 3)) * np.sqrt(values + tau**2)
    share = np.ones(n)
    for robust in (False, True):
        # 12,000 squares know their mean to 1.3 %, and tau to a little more than half of that.
        assert common_sigma(v**2, values, share, robust=robust) == pytest.approx(tau, rel=0.05)
    assert common_sigma(0.5 * values, values, share, robust=False) == 0.0
    v[:200] = 50.0
    assert common_sigma(v**2, values, share, robust=True) == pytest.approx(tau, rel=0.15)


@pytest.mark.parametrize("robust", [False, True])
def test_the_added_standard_deviation_does_not_depend_on_the_pieces(
    robust: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    values, rng = RNG.uniform(0.01, 0.2, (50, 3)) ** 2, np.random.default_rng(3)
    squares, share = values * rng.chisquare(1, (50, 3)) * 4.0, np.where(np.arange(50) % 7 == 0, np.nan, 0.8)
    at_once = common_sigma(squares, values, share, robust=robust)
    monkeypatch.setattr(variance_components, "CHUNK", 7)
    assert common_sigma(squares, values, share, robust=robust) == pytest.approx(at_once, rel=1e-8)
    assert at_once > 0


def test_the_added_standard_deviation_of_many_records_leaves_nothing_in_memory() -> None:
    squares, n = np.random.default_rng(1).normal(size=(20_000, 3)) ** 2, 20_000
    gc.disable()  # what is left in a cycle would go with the next collection, who knows when
    try:
        tracemalloc.start()
        common_sigma(5 * squares, np.ones((n, 3)), np.ones(n))  # imports what it needs
        before = tracemalloc.get_traced_memory()[0]
        common_sigma(5 * squares, np.ones((n, 3)), np.ones(n))
        assert tracemalloc.get_traced_memory()[0] - before < squares.nbytes / 10
    finally:
        tracemalloc.stop()
        gc.enable()


# The added standard deviation is found though what is asked for depends on the one in use, and jumps.


@dataclass(frozen=True)
class Made:
    """An adjustment without gross errors that asks for a standard deviation."""

    tau: float
    asks: Callable[[float], float]

    test: Float = field(default_factory=lambda: np.zeros(3))

    def controlled(self, rows: Int) -> Bool:
        return np.ones(len(rows), dtype=bool)

    def added_sigma(self, *, robust: bool) -> float:
        return self.asks(self.tau)


RULE = Snooping(4.0)


def _pool_of_search_steps(n: int) -> Pool:
    touches = (("strip", np.zeros(n, dtype=int)), ("point", np.arange(n) // 2))
    records = Records(
        "tie", touches, lambda state, rows: (np.zeros((len(rows), 1)), ()), np.ones((n, 1)), np.ones(n, bool)
    )
    return pool_of(RULE, [records], [np.ones(n)])


def _searched(asks: Callable[[float], float]) -> tuple[float, int, bool]:
    rule, pool = RULE, _pool_of_search_steps(3)
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


@pytest.mark.parametrize(("wrong", "first_robust"), [((5.0, 5.0), False), ((5.0, 90.0), True)])
def test_what_could_not_move_the_added_standard_deviation_is_rejected_only_with_that_of_all_residuals(
    wrong: tuple[float, float], first_robust: bool
) -> None:
    """Two of 2,000: with tests of 5 they make up 2.5 % of the squares expected, with one of 90 four times all."""
    tests = np.full(2000, 1.0)
    tests[[100, 700]] = wrong
    asked: list[tuple[bool, int]] = []

    @dataclass(frozen=True)
    class Watched(Made):
        out: int = 0

        def added_sigma(self, *, robust: bool) -> float:
            asked.append((robust, self.out))
            return 1.0

    found = search(
        lambda before, use, tau: Watched(tau, lambda _: 1.0, tests, int((~use).sum())),
        np.ones(2000, bool),
        RULE,
        _pool_of_search_steps(2000),
    )
    assert np.flatnonzero(~found.active).tolist() == [100, 700]
    assert any(robust and out for robust, out in asked) == first_robust
    assert asked[-1] == (False, 2)


def test_a_rejection_that_leaves_something_open_is_not_made_and_is_told() -> None:
    """Record 0 has the largest test, but alone determines something; record 2, elsewhere, goes."""
    tests = np.full(20, 0.5)
    tests[[0, 2]] = 9.0, 6.0

    def solve(before: Made | None, use: Bool, tau: float) -> Made:
        if not use[0]:
            raise GeometryError("the observations leave 1 unknown open")
        return Made(tau, lambda _: 0.0, np.where(use, tests, np.nan))

    found = search(solve, np.ones(20, dtype=bool), RULE, _pool_of_search_steps(20))
    assert found.settled
    assert np.flatnonzero(~found.active).tolist() == [2]
    assert np.flatnonzero(found.above).tolist() == [0]


@pytest.mark.parametrize("needed", [[0], [4], [2, 10], [0, 2, 4, 6, 8, 10]])
def test_of_several_that_go_at_once_only_those_stay_that_are_needed(needed: list[int]) -> None:
    """Each of them alone determines something; two of a point go together or not at all."""
    wrong = [0, 2, 4, 6, 8, 10, 11]
    tests = np.full(800, 0.5)
    tests[wrong] = 9.0, 8.0, 7.0, 6.5, 6.0, 5.5, 5.2

    def solve(before: Made | None, use: Bool, tau: float) -> Made:
        if not use[needed].all():
            raise GeometryError("the observations leave 1 unknown open")
        return Made(tau, lambda _: 0.0, tests)

    found = search(
        solve,
        np.ones(800, dtype=bool),
        RULE,
        _pool_of_search_steps(800),
        lambda solved, use: use & (solved.test > RULE.limit),
    )
    assert found.settled
    stay = [*needed, 11] if 10 in needed else needed
    assert np.flatnonzero(~found.active).tolist() == [row for row in wrong if row not in stay]
    assert np.flatnonzero(found.above).tolist() == stay


def test_what_is_open_from_the_first_stays_an_error() -> None:
    def solve(before: Made | None, use: Bool, tau: float) -> Made:
        raise GeometryError("the observations leave 1 unknown open")

    with pytest.raises(GeometryError):
        search(solve, np.ones(4, dtype=bool), RULE, _pool_of_search_steps(4))
