"""Two of six control points with each other's number are found; single errors and right points are not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.orientation.bodies.exchanged_control import exchanged_control


@pytest.mark.parametrize("seed", range(10))
def test_two_of_six_are_found_and_none_else(seed: int) -> None:
    rng = np.random.default_rng(seed)
    X = rng.uniform(0, 1, (6, 3)) * [2000.0, 1500.0, 60.0]
    x = (X @ Rotation.from_rotvec([0.01, 0.02, 1.0]).as_matrix()) * 1e-3 + rng.normal(0, 1e-4, (6, 3))  # 10 cm
    assert not exchanged_control(x, X).any()
    rows = rng.choice(6, 2, replace=False)
    wrong = X.copy()
    wrong[rows] = X[rows[::-1]]
    assert set(np.flatnonzero(exchanged_control(x, wrong)).tolist()) == set(rows.tolist())
    off = X.copy()
    off[rows[0]] += [300.0, -200.0, 10.0]
    assert not exchanged_control(x, off).any()


@pytest.mark.parametrize("seed", range(5))
def test_two_of_three_are_found_beside_positions_which_nobody_exchanges(seed: int) -> None:
    rng = np.random.default_rng(seed)
    X = rng.uniform(0, 1, (12, 3)) * [2000.0, 1500.0, 60.0]
    X[3:, 2] += 1000.0
    x = (X @ Rotation.from_rotvec([0.01, 0.02, 1.0]).as_matrix()) * 1e-3 + rng.normal(0, 1e-4, (12, 3))
    assert not exchanged_control(x, X, 3).any()
    wrong = X.copy()
    wrong[[0, 2]] = X[[2, 0]]
    assert np.flatnonzero(exchanged_control(x, wrong, 3)).tolist() == [0, 2]
    assert not exchanged_control(x[:3], wrong[:3]).any()  # without them two of three cannot be left out
