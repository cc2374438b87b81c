"""The factor of heights: found and named where there is relief, with a tilt and errors; else nothing is said."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aatri.orientation.bodies.datum_analysis import GivenPlaces
from aatri.orientation.bodies.ground_fit import _stretch
from aatri.orientation.bodies.height_factor import height_factor


def _control(n: int = 12, relief_m: float = 40.0, seed: int = 2) -> np.ndarray:
    chance = np.random.default_rng(seed)
    return np.column_stack([chance.uniform(0, 2000, (n, 2)), chance.uniform(100, 100 + relief_m, n)])


def _model(truth: np.ndarray, noise_m: float = 0.3, tilt: float = 0.02, scale: float = 1.001) -> np.ndarray:
    """The control as a model has it that was tilted, scaled and shifted by a bad similarity."""
    turn = np.array([[1, 0, tilt], [0, 1, -tilt], [-tilt, tilt, 1]])
    noise = np.random.default_rng(7).normal(0, noise_m, truth.shape)
    return np.asarray(scale * (truth - 500.0) @ turn.T + noise + 480.0)


ALL = np.ones((12, 3), bool)


@pytest.mark.parametrize(
    ("factor", "cause"),
    [
        (1 / 0.3048, "feet"),
        (0.95 / 0.3048, "feet"),
        (0.3048, "divided by 3.28"),
        (-1.0, "downwards"),
        (2.5, "principal"),
    ],
)
def test_a_factor_is_found_with_its_standard_deviation_and_named(factor: float, cause: str) -> None:
    truth = _control()
    found = height_factor(_model(truth), truth * [1, 1, factor], ALL)
    assert found is not None
    assert abs(found.factor - factor) < 4 * found.sigma + 0.005 * abs(factor)
    assert 0 < found.sigma < 0.07 * abs(factor)
    assert cause in found.cause
    assert found.certain


def test_a_principal_distance_to_be_calibrated_is_not_certain() -> None:
    truth = _control()
    found = height_factor(_model(truth, noise_m=0.05), truth * [1, 1, 1.3], ALL)
    assert found is not None
    assert "principal distance" in found.cause
    assert not found.certain


@pytest.mark.parametrize("seed", range(20))
def test_of_heights_that_fit_nothing_is_said(seed: int) -> None:
    truth = _control(seed=seed)
    assert height_factor(_model(truth), truth, ALL) is None


@pytest.mark.parametrize("seed", range(20))
def test_over_flat_ground_nothing_is_said(seed: int) -> None:
    truth = _control(relief_m=0.5, seed=seed)
    assert height_factor(_model(truth), truth / [1, 1, 0.3048], ALL) is None


def test_one_wrong_height_and_too_few_heights_say_nothing() -> None:
    truth = _control()
    given = truth.copy()
    given[3, 2] += 300.0
    assert height_factor(_model(truth), given, ALL) is None
    few = ALL.copy()
    few[5:, 2] = False
    assert height_factor(_model(truth), truth / [1, 1, 0.3048], few) is None
    assert height_factor(_model(truth), truth / [1, 1, 0.3048], ALL & [False, False, True]) is None


def test_heights_that_are_guessed_say_nothing_of_their_unit() -> None:
    """One height of all points, give or take 5 m: what relief there is lies within, or may."""
    truth = _control(relief_m=20.0)
    guessed = np.column_stack([truth[:, :2], np.full(12, 350.0)])
    warned = height_factor(_model(truth), guessed, ALL)
    assert warned is not None
    assert "all alike" in str(warned)
    assert warned.factor == 0.0
    assert not warned.certain  # a lens that is not calibrated bends a model over flat ground
    assert height_factor(_model(truth), guessed, ALL, np.full(12, 5.0)) is None


def test_some_guessed_heights_do_not_hide_the_unit_of_the_others() -> None:
    truth = _control()
    given, sigma = truth / [1, 1, 0.3048], np.where(np.arange(12) < 3, 50.0, 0.02)
    given[:3, 2] = 0.0
    found = height_factor(_model(truth), given, ALL, sigma)
    assert found is not None
    assert "feet" in found.cause


def test_control_of_exactly_one_height_tells_no_factor() -> None:
    rng = np.random.default_rng(8)
    plan_m = rng.uniform(0.0, 500.0, (9, 2))
    model_m = np.column_stack([plan_m, 2e-4 * rng.standard_normal(9)])
    given_m = np.column_stack([plan_m, np.full(9, 6.0)])
    assert height_factor(model_m, given_m, np.ones((9, 3), dtype=bool), np.zeros(9)) is None


def test_control_and_positions_of_one_height_ask_for_no_principal_distance() -> None:
    """As where nobody has written heights: their factor is 0, and none divides by it."""
    rng, n = np.random.default_rng(3), 12
    xyz_m = np.column_stack([rng.uniform(0.0, 500.0, (n, 2)), rng.normal(0.0, 5.0, n)])
    kind, name = np.repeat(["control", "position"], n // 2), np.arange(n).astype(np.str_)
    level = GivenPlaces(kind, name, xyz_m, xyz_m * [1, 1, 0], np.ones((n, 3), dtype=bool), np.arange(n))
    assert height_factor(level.xyz, level.observed_m, level.given) is not None
    body: Any = SimpleNamespace(places=level)
    block: Any = None
    assert _stretch(block, body) == ""
