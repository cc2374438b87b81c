"""Scales of standard deviations: of classes, of small ones, beside long tails, by weight functions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from aatri.adjustment.statistics.class_scales import EFFICIENCY, class_scales, robust_scale, small_class_scale
from aatri.adjustment.statistics.limits import BEYOND_TAIL, LEAST_FREEDOM, limit_of_tests
from aatri.adjustment.statistics.long_tails import Tail, tail_of
from aatri.adjustment.statistics.reliability import tau_limit
from aatri.adjustment.statistics.weight_functions import BOUNDS, FLOOR, weights
from aatri.arrays import Float

# Scales of classes of observations, with gross errors among them.


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


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("n", [8, 40, 400])
def test_right_standard_deviations_are_blamed_as_rarely_as_stated(n: int) -> None:
    rng, wrong = np.random.default_rng(4), 0
    for _ in range(3000):
        found = class_scales(rng.standard_normal(n), np.ones(n), np.zeros(n, dtype=np.int64), 1)
        wrong += found.differing[0] != 1.0
    assert wrong <= 12  # 3 expected; 12 by chance once in 10,000


# Standard deviations of a few control points that are too small: the distribution of residuals tells, or nothing.

POINTS, SIGMA = 13, 0.2
RECORD = np.repeat(np.arange(POINTS), 3)


def _cofactor(sigma: float) -> Float:
    """Of 39 whitened residuals of control given to `sigma`, where the images see each coordinate to 1, but no datum."""
    N = np.eye(39) - np.kron(np.ones((POINTS, POINTS)) / POINTS, np.eye(3))  # the images know no translation
    return np.eye(39) - np.linalg.inv(np.eye(39) + sigma**2 * N)


def _residuals(scale: float, seed: int, sigma: float = SIGMA) -> tuple[Float, Float]:
    """v of errors `scale` times those given: v = R e + what the images' errors do, cofactor R (s^2 R + I - R)."""
    R = _cofactor(sigma)
    size, axes = np.linalg.eigh(R)
    variance = np.maximum(size, 0.0) * (1.0 + (scale**2 - 1.0) * np.maximum(size, 0.0))
    return axes @ (np.sqrt(variance) * np.random.default_rng(seed).standard_normal(39)), R


@pytest.mark.slow
def test_right_standard_deviations_are_left_alone() -> None:
    told = sum(small_class_scale(*_residuals(1.0, seed), RECORD)[0] > 1.0 for seed in range(600))
    assert told <= 3  # 0.6 by the level of 0.1 %; more than 3 once in 300
    told = sum(small_class_scale(*_residuals(1.0, seed, 5.0), RECORD)[0] < 1.0 for seed in range(600))
    assert told <= 3


@pytest.mark.parametrize("scale", [0.1, 0.2])
def test_a_multiple_of_the_true_ones_is_told(scale: float) -> None:
    found = np.array([small_class_scale(*_residuals(scale, seed, 5.0), RECORD) for seed in range(10)])
    assert (found[:, 0] < 1.0).all()
    assert np.median(found[:, 0]) == pytest.approx(scale, rel=0.15)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("scale", [5.0, 10.0])
def test_a_fraction_of_the_true_ones_is_told(scale: float) -> None:
    found = np.array([small_class_scale(*_residuals(scale, seed, 0.5), RECORD) for seed in range(40)])
    assert (found[:, 0] > 1.0).all()
    assert np.median(found[:, 0]) == pytest.approx(scale, rel=0.15)
    size = np.linalg.eigvalsh(_cofactor(0.5 * scale)).sum()  # redundancy with the right standard deviations
    assert np.median(found[:, 1]) == pytest.approx(size, rel=0.1)


@pytest.mark.slow(after=1)
def test_the_largest_of_scaled_errors_are_not_taken_for_gross_ones() -> None:
    """Of 12 positions, each three components, which a block sees 0.3 to 30 times as well as they are given."""
    rng, trials = np.random.default_rng(5), 200
    told, record = 0, np.repeat(np.arange(12), 3)
    for _ in range(trials):
        axes, variance = np.linalg.qr(rng.standard_normal((36, 36)))[0], np.logspace(-1, 3, 36)
        R = (axes / (1 + variance)) @ axes.T
        error = 5.0 * rng.standard_normal(36) + axes @ (np.sqrt(variance) * rng.standard_normal(36))
        told += small_class_scale(R @ error, R, record)[0] > 1.0
    assert told >= 0.95 * trials


def test_next_to_no_redundancy_tells_nothing() -> None:
    """Of images that see the points twenty times worse than the control is given."""
    told = [small_class_scale(*_residuals(5.0, seed, 0.05), RECORD)[0] > 1.0 for seed in range(40)]
    assert sum(told) < 4


@pytest.mark.parametrize("wrong", [[4], [2, 9]])
def test_gross_errors_are_no_scale(wrong: list[int]) -> None:
    v, R = _residuals(1.0, 1, 0.5)
    error = np.zeros(39)
    error[np.isin(RECORD, wrong)] = 60.0
    assert small_class_scale(v + R @ error, R, RECORD)[0] == 1.0


def test_one_record_alone_has_a_gross_error_and_no_scale() -> None:
    assert small_class_scale(np.full(3, 20.0), np.diag([0.3, 0.3, 0.2]), np.zeros(3, dtype=np.int64))[0] == 1.0


def test_one_gross_error_of_another_kind_that_explains_as_much_is_no_scale() -> None:
    """A wrong control point beside positions leaves v'R^-v in these; a record that is none of its causes far less."""
    v, R = _residuals(10.0, 1, 0.5)
    explains_all = float(v @ np.linalg.pinv(R, 1e-9, hermitian=True) @ v)
    assert small_class_scale(v, R, RECORD, gain_of_others=explains_all)[0] == 1.0
    assert small_class_scale(v, R, RECORD, gain_of_others=0.1 * explains_all)[0] == pytest.approx(10.0, rel=0.3)


# The tail of errors: where the limit of a residual comes from.

N = 4000
LEVELS = (np.arange(N) + 0.5) / N
LIMIT = limit_of_tests(N)


@pytest.mark.parametrize("freedom", [5.0, 8.0])
@pytest.mark.parametrize("scale", [0.8, 1.0, 1.5])
def test_the_limit_is_that_of_the_longest_tail_that_the_residuals_allow(freedom: float, scale: float) -> None:
    tail = tail_of(np.abs(scale * stats.t(freedom).ppf(LEVELS)), LIMIT * scale)
    assert 0.75 * freedom <= tail.freedom <= 1.05 * freedom
    limit = scale * stats.t(freedom).isf(BEYOND_TAIL / 2)
    assert 0.97 * limit <= tail.limit <= 1.35 * limit


def test_few_normal_residuals_allow_a_tail_and_many_do_not() -> None:
    levels = (np.arange(400) + 0.5) / 400
    limit = limit_of_tests(400)
    assert limit < tail_of(np.abs(stats.norm.ppf(levels)), limit).limit < 1.5 * limit


def test_normal_errors_have_the_limit_that_counts_the_tests() -> None:
    assert tail_of(np.abs(stats.norm.ppf(LEVELS)), LIMIT) == Tail(np.inf, LIMIT)


def test_gross_errors_make_no_tail() -> None:
    w = np.abs(stats.norm.ppf(LEVELS))
    w[:: N // 200] = np.geomspace(6.0, 1000.0, len(w[:: N // 200]))
    assert tail_of(w, LIMIT).limit < 1.2 * LIMIT


@pytest.mark.parametrize(("share", "times"), [(0.02, 8), (0.05, 8), (0.1, 8), (0.1, 15)])
def test_a_tenth_of_errors_some_times_as_large_as_the_others_makes_no_tail_of_measurements(
    share: float, times: float
) -> None:
    """Mismatches of a few pixels: Student's errors of four degrees of freedom would be gross from 13 or 17 sigma on.

    Series of observations have 4 to 9 (Jeffreys 1961, 5.7). A limit 1.3 times as large hides 11 % of the wrong errors
    that are eight times as large: P(|z| < 1.3 LIMIT / 8) - P(|z| < LIMIT / 8).
    """
    n_wrong = round(share * N)
    right = stats.norm.ppf((np.arange(N - n_wrong) + 0.5) / (N - n_wrong))
    wrong = times * stats.norm.ppf((np.arange(n_wrong) + 0.5) / n_wrong)
    tail = tail_of(np.abs(np.append(right, wrong)), LIMIT)
    assert tail.freedom > 9.0
    assert tail.limit < 1.3 * LIMIT


@pytest.mark.parametrize("far", [[30.0, 30.001], [100.0, 100.01, 100.02], [23.0]])
def test_a_few_gross_errors_of_one_size_do_not_hide_a_tail(far: list[float]) -> None:
    """Two numbers exchanged in an image, the two rays of a point: they lie beyond where gross errors are counted."""
    w = np.abs(stats.t(5.0).ppf(LEVELS))
    assert tail_of(np.append(w, far), LIMIT).limit == pytest.approx(tail_of(w, LIMIT).limit, rel=0.05)


def test_longer_tails_than_measurements_have_are_gross_errors() -> None:
    assert tail_of(np.abs(stats.t(1.5).ppf(LEVELS)), LIMIT).freedom >= LEAST_FREEDOM


def test_a_few_residuals_have_no_tail() -> None:
    w = np.append(np.abs(stats.norm.ppf((np.arange(50) + 0.5) / 50)), 4.8)
    assert tail_of(w, 4.0).limit == 4.0


def test_images_of_unlike_quality_make_a_tail() -> None:
    """Their mixture is not normal, and its largest residuals are no gross errors."""
    rng = np.random.default_rng(3)
    w = np.abs(rng.uniform(0.6, 1.6, N) * rng.standard_t(5, N) * np.sqrt(3 / 5))
    assert (w > tail_of(w, LIMIT).limit).mean() < 1e-3 < 2 * (w > LIMIT).mean()


# Weight functions against their published forms, and the tau test against its own distribution.


@pytest.mark.parametrize(
    ("name", "s", "expected"),
    [
        ("huber", 8.0, 0.25),  # 2 / 8
        ("danish", 4.0, np.exp(-3.0)),  # (4 / 2)^2 = 4
        ("igg3", 4.0, 0.5 * (0.5) ** 2),  # k 2, k1 6: 2/4 ((6 - 4) / 4)^2
        ("igg3", 7.0, FLOOR),
        ("li_posterior", 5.0, 0.04),
        ("cauchy", 6.0, 0.1),  # 1 / (1 + 3^2)
    ],
)
def test_weights_with_the_bound_two_are_the_published(name: str, s: float, expected: float) -> None:
    assert weights(name, np.array([s]), 2.0)[0] == pytest.approx(expected, rel=1e-12)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", list(BOUNDS))
def test_weights_fall_from_one_and_their_cost_is_concave_in_the_square(name: str) -> None:
    s = np.linspace(0.0, 30.0, 3001)
    w = weights(name, s, BOUNDS[name])  # type: ignore[index,arg-type]
    assert w[0] == 1.0
    assert (np.diff(w) <= 0).all()
    assert (w >= FLOOR).all()


@pytest.mark.slow
@pytest.mark.parametrize("redundancy", [3, 10, 100])
def test_the_limit_of_tau_is_exceeded_as_often_as_that_of_w(redundancy: int) -> None:
    """tau of one of r independent residuals: x1 / rms(x); the share beyond is 1 % within 3 sigma of 400,000 samples."""
    x = np.random.default_rng(7).standard_normal((400_000, redundancy))
    tau = x[:, 0] / np.sqrt((x**2).mean(axis=1))
    beyond = (np.abs(tau) > tau_limit(2.5758293035489, redundancy)).mean()
    assert abs(beyond - 0.01) < 3 * np.sqrt(0.01 * 0.99 / 400_000)


def test_without_redundancy_nothing_is_beyond() -> None:
    assert tau_limit(4.0, 1) == np.inf
