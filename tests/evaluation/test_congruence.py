"""Congruence of two epochs: statistics of many made-up epochs, and against other ways of computing them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom, chi2, ncx2

from aatri.errors import GeometryError
from aatri.evaluation.congruence import congruence, explain_as_well
from aatri.evaluation.epochs import datum_directions

LEVEL = 0.05


def _network(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Places of n points, and a covariance with strong correlations between them."""
    xyz_m = rng.uniform(-100.0, 100.0, (n, 3)) * [1, 1, 0.2]
    A = rng.normal(size=(3 * n, 3 * n))
    return xyz_m, (A @ A.T / (3 * n) + 0.1 * np.eye(3 * n)) * 1e-4


def _gain_by_two_adjustments(d: np.ndarray, C: np.ndarray, H: np.ndarray, free: np.ndarray) -> float:
    """Drop of the sum of squares where some components are unknowns of their own; dense least squares."""
    L = np.linalg.inv(np.linalg.cholesky(C))
    squares = []
    for columns in (H, np.column_stack([H, np.eye(len(d))[:, free]])):
        A = L @ columns
        r = L @ d - (A @ np.linalg.lstsq(A, L @ d, rcond=None)[0] if columns.shape[1] else 0.0)
        squares.append(float(r @ r))
    return squares[0] - squares[1]


@pytest.mark.parametrize("datum", ["none", "shift", "rigid", "similarity"])
def test_gains_and_displacements_are_those_of_two_adjustments(datum) -> None:
    rng = np.random.default_rng(1)
    xyz_m, C = _network(rng, 8)
    H = datum_directions(xyz_m, datum)
    d = rng.multivariate_normal(np.zeros(24), C)
    result = congruence(d, C, np.repeat(np.arange(8), 3), H, level=1e-9)
    assert not result.moved.any()
    for k in range(8):
        rows = np.arange(3 * k, 3 * k + 3)
        np.testing.assert_allclose(result.statistics[k], _gain_by_two_adjustments(d, C, H, rows), rtol=1e-7)
    whole = np.linalg.inv(np.linalg.cholesky(C))
    A, b = whole @ H, whole @ d
    r = b - (A @ np.linalg.lstsq(A, b, rcond=None)[0] if H.shape[1] else 0.0)
    np.testing.assert_allclose(result.statistic, r @ r, rtol=1e-8)
    assert result.degrees == 24 - H.shape[1]


def test_a_datum_moved_by_a_similarity_is_no_movement_of_points() -> None:
    rng = np.random.default_rng(2)
    xyz_m, C = _network(rng, 10)
    H = datum_directions(xyz_m, "similarity")
    noise = rng.multivariate_normal(np.zeros(30), C)
    moved = noise + H @ np.array([5.0, -3.0, 2.0, 0.4, 0.1, -0.2, 0.3])
    object_of = np.repeat(np.arange(10), 3)
    first, second = (congruence(d, C, object_of, H) for d in (noise, moved))
    np.testing.assert_allclose(first.statistics, second.statistics, rtol=1e-6)
    np.testing.assert_allclose(first.displacement, second.displacement, atol=1e-8)


def test_a_singular_covariance_of_free_networks_is_taken() -> None:
    rng = np.random.default_rng(3)
    xyz_m, C = _network(rng, 10)
    H = datum_directions(xyz_m, "similarity")
    project = np.eye(30) - H @ np.linalg.pinv(H)  # inner constraints over all points
    free = project @ C @ project.T
    d = rng.multivariate_normal(np.zeros(30), C)
    object_of = np.repeat(np.arange(10), 3)
    np.testing.assert_allclose(
        congruence(project @ d, free, object_of, H).statistics, congruence(d, C, object_of, H).statistics, rtol=1e-5
    )
    with pytest.raises(GeometryError, match="singular"):
        congruence(project @ d, free, object_of)


@pytest.mark.slow
def test_without_movement_false_alarms_have_the_stated_level() -> None:
    rng = np.random.default_rng(4)
    xyz_m, C = _network(rng, 20)
    H, L = datum_directions(xyz_m, "rigid"), np.linalg.cholesky(C)
    object_of, n = np.repeat(np.arange(20), 3), 300
    alarms, squares = 0, 0.0
    for _ in range(n):
        result = congruence(L @ rng.normal(size=60), C, object_of, H, level=LEVEL)
        alarms += bool(result.moved.any())
        squares += result.statistic
    assert squares / n == pytest.approx(54.0, abs=4 * np.sqrt(2 * 54 / n))
    assert alarms / n <= LEVEL + 3 * np.sqrt(LEVEL * (1 - LEVEL) / n)  # correlated tests: never more than Sidak's level
    assert alarms / n >= LEVEL / 2 - 3 * np.sqrt(LEVEL / 2 / n)


@pytest.mark.slow
@pytest.mark.parametrize("noncentrality", [10.0, 20.0, 40.0])
def test_a_movement_is_found_as_the_noncentral_distribution_says(noncentrality: float) -> None:
    rng = np.random.default_rng(5)
    xyz_m, C = _network(rng, 20)
    H, L = datum_directions(xyz_m, "similarity"), np.linalg.cholesky(C)
    object_of, n = np.repeat(np.arange(20), 3), 200
    own = congruence(np.zeros(60), C, object_of, H).covariance[7]
    direction = np.linalg.cholesky(own) @ np.array([1.0, 0.0, 0.0])
    d0 = np.zeros(60)
    d0[21:24] = direction * np.sqrt(noncentrality)
    of_one = 1 - (1 - LEVEL) ** (1 / 20)
    expected = float(ncx2.sf(chi2.isf(of_one, 3), 3, noncentrality))
    statistic = [congruence(d0 + L @ rng.normal(size=60), C, object_of, H).statistics[7] for _ in range(n)]
    found = float(np.mean(np.array(statistic) > chi2.isf(of_one, 3)))
    assert found == pytest.approx(expected, abs=4 * np.sqrt(expected * (1 - expected) / n) + 0.01)


def test_several_movements_are_told_apart_and_their_sizes_are_right() -> None:
    rng = np.random.default_rng(6)
    xyz_m, C = _network(rng, 30)
    H, d = datum_directions(xyz_m, "similarity"), rng.multivariate_normal(np.zeros(90), C)
    moved = np.array([3, 4, 17, 25])
    shift = np.array([[0.5, 0, 0], [0.5, 0, 0], [0, -0.3, 0.1], [0, 0, 0.4]])
    d.reshape(-1, 3)[moved] += shift
    result = congruence(d, C, np.repeat(np.arange(30), 3), H)
    assert np.flatnonzero(result.moved).tolist() == moved.tolist()
    for k, s in zip(moved, shift):
        error = result.displacement[3 * k : 3 * k + 3] - s
        assert error @ np.linalg.solve(result.covariance[k], error) < chi2.isf(1e-4, 3)


def test_a_point_that_the_datum_needs_is_not_tested() -> None:
    xyz_m = np.array([[0.0, 0, 0], [100, 0, 0], [0, 100, 0]])
    H = datum_directions(xyz_m, "similarity")
    result = congruence(np.full(9, 0.01), np.eye(9) * 1e-6, np.repeat(np.arange(3), 3), H)
    assert not result.tested.any()
    assert not result.moved.any()
    assert np.isnan(result.displacement).all()


def test_an_estimated_sigma0_takes_the_distribution_of_f() -> None:
    d, object_of = np.array([0.3, -0.1, 0.2, 7.0]), np.arange(4)
    exact = congruence(d, np.eye(4), object_of, sigma0=2.0, sigma0_degrees=1e9)
    scaled = congruence(d, 4 * np.eye(4), object_of)
    np.testing.assert_allclose(exact.probabilities, scaled.probabilities, rtol=1e-5)
    few = congruence(d, np.eye(4), object_of, sigma0=2.0, sigma0_degrees=3)
    assert (few.limits > exact.limits).all()
    assert (few.probabilities > exact.probabilities).all()


def test_of_two_that_can_hardly_be_told_apart_the_other_is_named_beside_the_one_that_explains_most() -> None:
    """Of changes of one of two components with a correlation of 0.98 no more than 5 % are left out of both."""
    rng, C = np.random.default_rng(12), np.eye(4)
    C[0, 1] = C[1, 0] = 0.98
    L, named, left_out = np.linalg.cholesky(C), 0, 0
    for _ in range(100):
        d = L @ rng.standard_normal(4) + [1.2, 0.0, 0.0, 0.0]  # 6 standard deviations beside the others
        moved = congruence(d, C, np.arange(4), level=LEVEL).moved
        if moved.sum() == 1:
            named += 1
            left_out += not (moved[0] or explain_as_well(d, C, np.arange(4), moved, level=LEVEL)[moved, 0].any())
    assert named > 50
    assert left_out <= binom.isf(1e-4, named, LEVEL)
    d = np.array([1.2, 0.0, 0.0, 0.0])
    first = congruence(d, C, np.arange(4), level=LEVEL).moved
    assert first.tolist() == [True, False, False, False]
    assert explain_as_well(d, C, np.arange(4), first)[0].tolist() == [False, True, False, False]
    assert not explain_as_well(3 * d, C, np.arange(4), first).any()
