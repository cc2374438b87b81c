"""Scales of classes of observations, with gross errors among them."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment.statistics.class_scales import EFFICIENCY, class_scales, robust_scale


@pytest.mark.parametrize("share", [0.0, 0.01, 0.05])
@pytest.mark.parametrize("true", [0.2, 1.0, 5.0])
def test_the_scale_is_found_beside_gross_errors(share: float, true: float) -> None:
    rng = np.random.default_rng(1)
    r = rng.uniform(0.1, 0.9, 20_000)
    v = true * np.sqrt(r) * rng.standard_normal(len(r))
    wrong = rng.random(len(r)) < share
    v[wrong] += true * rng.uniform(10, 1000, wrong.sum()) * r[wrong]
    assert robust_scale(v, r) == pytest.approx(true, rel=0.02)


def test_its_spread_is_as_stated() -> None:
    rng = np.random.default_rng(2)
    found = [robust_scale(rng.standard_normal(100), np.ones(100)) for _ in range(2000)]
    assert np.std(np.log(found)) == pytest.approx(np.sqrt(0.5 / EFFICIENCY) / 10, rel=0.1)


def _two_classes(n: int, *scales: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(3)
    group = np.repeat([0, 1], [5000, n])
    v = np.sqrt(0.5) * np.array(scales)[group] * rng.standard_normal(len(group))
    return v, np.full(len(group), 0.5), group


@pytest.mark.parametrize("true", [0.2, 0.5, 2.0, 5.0])
def test_a_class_that_is_wrong_beside_a_large_one_is_told(true: float) -> None:
    found = class_scales(*_two_classes(80, 1.0, true), 2)
    assert found.main == 0
    assert found.differing[0] == 1.0
    assert found.differing[1] == pytest.approx(true, rel=0.35)  # 2.5 of its standard deviations


def test_all_wrong_by_the_same_factor() -> None:
    found = class_scales(*_two_classes(80, 2.0, 2.0), 2)
    assert found.differing[0] == pytest.approx(2.0, rel=0.03)
    assert found.differing[1] == pytest.approx(2.0, rel=0.35)


def test_right_ones_and_those_without_redundancy_keep_theirs() -> None:
    assert class_scales(*_two_classes(80, 1.0, 1.0), 2).differing.tolist() == [1.0, 1.0]
    few = class_scales(*_two_classes(16, 1.0, 0.2), 2)
    assert few.estimable.tolist() == [True, False]
    assert few.differing.tolist() == [1.0, 1.0]


@pytest.mark.parametrize("n", [8, 40, 400])
def test_right_standard_deviations_are_blamed_as_rarely_as_stated(n: int) -> None:
    rng, wrong = np.random.default_rng(4), 0
    for _ in range(3000):
        found = class_scales(rng.standard_normal(n), np.ones(n), np.zeros(n, dtype=np.int64), 1)
        wrong += found.differing[0] != 1.0
    assert wrong <= 12  # 3 expected; 12 by chance once in 10,000
