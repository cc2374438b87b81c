"""Rules of rejection and re-admission, tests of records, the added standard deviation."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment.records import Records
from aatri.adjustment.small_matrices import inverse_cholesky
from aatri.adjustment.statistics.rejection import Snooping, clearest, fitting, pool_of, stranded
from aatri.adjustment.statistics.variance_components import common_sigma

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
