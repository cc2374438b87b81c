"""What leaving out one record explains, held against adjustments without it."""

from __future__ import annotations

import numpy as np

from aatri.adjustment.statistics.leave_one_out import as_good, gains_of_leaving_out


def _of_line(y: np.ndarray, A: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    H = A @ np.linalg.pinv(A.T @ A) @ A.T
    return (H - np.eye(len(y))) @ y, H


def test_the_gain_is_the_fall_of_the_sum_of_squares_without_the_record() -> None:
    rng = np.random.default_rng(1)
    A, y = rng.standard_normal((8, 3)), rng.standard_normal(8)
    y[2] += 20
    v, H = _of_line(y, A)
    gain = gains_of_leaving_out(v[:, None], np.diag(H)[:, None, None])
    for k in range(8):
        rest = np.arange(8) != k
        less, _ = _of_line(y[rest], A[rest])
        assert np.isclose(gain[k], v @ v - less @ less)
    assert np.flatnonzero(as_good(gain)).tolist() == [2]


def test_two_bars_that_contradict_each_other_cannot_be_told_apart_and_three_can() -> None:
    for n, told in ((2, [0, 1]), (3, [1])):
        A, y = np.ones((n, 1)), np.zeros(n)
        y[1] = 30.0
        v, H = _of_line(y, A)
        gain = gains_of_leaving_out(v[:, None], np.diag(H)[:, None, None])
        assert np.flatnonzero(as_good(gain)).tolist() == told


def test_a_stretched_sheet_of_four_corners_names_all_of_them() -> None:
    """Similarity through the corners of a square stretched by 1 % in x: their residuals are equal by symmetry."""
    x, y = np.array([-1.0, 1, 1, -1]), np.array([-1.0, -1, 1, 1])
    rows = [(px, -py, 1, 0) for px, py in zip(x, y)], [(py, px, 0, 1) for px, py in zip(x, y)]
    A = np.stack(rows, axis=1).reshape(8, 4)
    v, H = _of_line(np.stack([1.01 * x, y], axis=1).ravel() / 1e-4, A)
    gain = gains_of_leaving_out(v.reshape(4, 2), np.stack([H[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] for k in range(4)]))
    assert as_good(gain).all()


def test_squares_that_are_little_below_the_largest_are_as_good() -> None:
    """5 below 100 are, 15 are not."""
    assert as_good(np.array([100.0, 95.0, 85.0])).tolist() == [True, True, False]
