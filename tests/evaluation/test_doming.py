"""Doming: a made bend is found with its size, noise is not."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from aatri.evaluation.doming import check_notes, doming

XY = np.array([[x, y] for x in np.linspace(-100, 100, 5) for y in np.linspace(-80, 80, 4)]) + 5e5


def test_a_bend_is_found_with_its_sag() -> None:
    r2 = ((XY - XY.mean(axis=0)) ** 2).sum(axis=1)
    noise = np.random.default_rng(2).normal(0, 0.01, len(XY))
    found = doming(XY, 0.1 - 0.6 * r2 / r2.max() + noise)
    assert found is not None
    assert found[0] == pytest.approx(-0.6, abs=4 * found[1])
    assert found[1] < 0.02


def test_noise_and_a_tilt_are_no_bend() -> None:
    for seed in range(20):
        noise = np.random.default_rng(seed).normal(0, 0.01, len(XY))
        found = doming(XY, 0.002 * (XY[:, 0] - 5e5) + noise)
        assert found is not None
        assert abs(found[0]) < 4 * found[1]


def test_too_few_points_and_points_on_a_circle_say_nothing() -> None:
    assert doming(XY[:5], np.zeros(5)) is None
    turn = np.linspace(0, 2 * np.pi, 9)[:-1]
    assert doming(np.column_stack([np.cos(turn), np.sin(turn)]), np.ones(8)) is None
    assert doming(XY, np.where(np.arange(len(XY)) < 5, 0.0, np.nan)) is None


def _bends(difference_m: np.ndarray, sigma_m: float, level: str = "warning") -> list[str]:
    n, ids = len(XY), np.array([f"p{k}" for k in range(len(XY))])
    of_z = np.column_stack([np.zeros((n, 2)), difference_m])
    differences = SimpleNamespace(
        kind=np.full(n, "check"), point=ids, difference_m=of_z, sigma_m=np.full((n, 3), sigma_m)
    )
    solution = SimpleNamespace(points=SimpleNamespace(xyz_m=np.column_stack([XY, np.zeros(n)])))
    block = SimpleNamespace(points=SimpleNamespace(id=ids))
    notes = check_notes(SimpleNamespace(differences=differences), block, solution)  # type: ignore[arg-type]
    return [note.text for note in notes if "bend" in note.text and note.level == level]


def test_a_bend_is_told_by_students_test_where_the_standard_deviations_do_not_allow_it() -> None:
    """Of 2,000 blocks of nothing but noise two are told; errors that are alike bend within what is allowed."""
    rng = np.random.default_rng(7)
    assert sum(bool(_bends(rng.normal(0, 0.01, len(XY)), 0.0)) for _ in range(2000)) <= 8  # binomial, 99.9 %
    r2 = ((XY - XY.mean(axis=0)) ** 2).sum(axis=1)
    bent = 0.06 * r2 / r2.max() + rng.normal(0, 0.005, len(XY))
    assert _bends(bent, 0.01)
    assert not _bends(bent, 0.05)


def test_errors_of_strips_that_add_up_to_a_bend_are_no_warning_where_nothing_says_how_large_they_may_be() -> None:
    """Heights after absolute orientation have no standard deviations: Student's test takes their errors for alike."""
    r2 = ((XY - XY.mean(axis=0)) ** 2).sum(axis=1)
    bent = -0.06 * r2 / r2.max() + np.random.default_rng(7).normal(0, 0.005, len(XY))
    assert not _bends(bent, np.nan)
    assert _bends(bent, np.nan, "note")
