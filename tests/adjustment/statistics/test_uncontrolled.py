"""Uncontrolled directions against dense least squares."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment.statistics.record_tests import uncontrolled_directions


def made(m: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Six records of m components; the first has a direction of its own unknown: nothing else controls it.

    Returns
    -------
    J (6 m, u), whitener (6, m, m) and the direction in units, (m,).
    """
    rng = np.random.default_rng(m)
    J = rng.normal(size=(6 * m, m + 2))
    direction = rng.normal(size=m)
    own = np.zeros((6 * m, 1))
    own[:m, 0] = direction
    whitener = np.tril(rng.normal(size=(6, m, m))) + 3 * np.eye(m)
    return np.hstack([J, own]), whitener, direction / np.linalg.norm(direction)


def redundancy(J: np.ndarray, whitener: np.ndarray) -> np.ndarray:
    n, m = whitener.shape[:2]
    L = np.zeros((n * m, n * m))
    for k in range(n):
        L[k * m : (k + 1) * m, k * m : (k + 1) * m] = whitener[k]
    A = L @ J
    R = np.eye(n * m) - A @ np.linalg.pinv(A)
    return np.stack([R[k * m : (k + 1) * m, k * m : (k + 1) * m] for k in range(n)])


@pytest.mark.parametrize("m", [1, 2, 3])
def test_the_direction_with_an_unknown_of_its_own_is_found_and_no_other(m: int) -> None:
    J, whitener, truth = made(m)
    rows, least, direction = uncontrolled_directions(redundancy(J, whitener), np.ones((6, m), dtype=bool), whitener)
    assert rows.tolist() == [0]
    assert least == pytest.approx(0.0, abs=1e-10)
    assert np.abs(direction[0] @ truth) == pytest.approx(1.0)
    assert np.linalg.norm(direction[0]) == pytest.approx(1.0)


def test_standard_deviations_that_differ_turn_the_direction_back_into_units() -> None:
    J, _, truth = made(2)
    sigma = np.tile([0.005, 0.02], (6, 1))
    R = redundancy(J, np.stack([np.diag(1 / s) for s in sigma]))
    _, _, direction = uncontrolled_directions(R, np.ones((6, 2), dtype=bool), 1 / sigma)
    assert np.abs(direction[0] @ truth) == pytest.approx(1.0)


def test_what_is_not_observed_or_not_known_is_not_listed() -> None:
    R = np.stack([np.array([[0.5, 0.3], [0.3, 0.0]]), np.full((2, 2), np.nan), np.diag([0.005, 0.0])])
    observed = np.array([[True, False], [True, True], [True, False]])
    rows, least, direction = uncontrolled_directions(R, observed, np.ones((3, 2)))
    assert rows.tolist() == [2]
    assert least.tolist() == [0.005]
    assert direction.tolist() == [[1.0, 0.0]]


def test_no_records_have_none() -> None:
    rows, _, direction = uncontrolled_directions(np.zeros((0, 2, 2)), np.zeros((0, 2), dtype=bool), np.zeros((0, 2)))
    assert len(rows) == 0
    assert direction.shape == (0, 2)
