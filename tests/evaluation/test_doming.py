"""Doming: a made bend is found with its size, noise is not."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.evaluation.doming import doming

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
