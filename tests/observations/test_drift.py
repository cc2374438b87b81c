"""Positions with shift and drift: derivatives by complex step, times reduced to the mean of their group."""

from __future__ import annotations

import numpy as np

from aatri.geometry.rotations import rotation_from_angles, skew
from aatri.observations.drift import DRIFT, drift_term, group_times
from aatri.observations.poses import POSE, Poses
from aatri.observations.positions import Positions, observed_positions
from tests.complex_step import complex_step


def _positions(rng: np.random.Generator, n: int) -> Positions:
    at = np.arange(n, dtype=np.int32)
    return Positions(at, at, rng.normal(0, 50, (n, 3)), np.tile(0.01 * np.eye(3), (n, 1, 1)), rng.normal(0, 1, (n, 3)))


def test_derivatives_are_those_of_the_complex_step() -> None:
    rng = np.random.default_rng(2)
    rows, n = _positions(rng, 3), 3
    R = np.stack([rotation_from_angles(rng.uniform(-3, 3, 3)) for _ in range(n)])
    X0, d, time = rng.normal(0, 50, (n, 3)), rng.normal(0, 1, (1, 6)), np.array([-2.0, 0.5, 1.5])
    (o,) = observed_positions(rows, np.zeros(3), np.array(list("abc")), None, [drift_term(np.full(n, "g"), time)])
    v, (by_pose, by_drift) = o.records.evaluate({POSE: Poses(X0, R), DRIFT: d}, np.arange(n))
    for k in range(n):

        def f(z: np.ndarray, k: int = k) -> np.ndarray:
            turned = (np.eye(3) + skew(z[3:6])) @ R[k] @ rows.lever_arm_m[k]
            return z[:3] + turned + z[6:9] + time[k] * z[9:] - rows.position_m[k]

        z = np.concatenate([X0[k], np.zeros(3), d[0]])
        np.testing.assert_allclose(v[k], f(z), atol=1e-11)
        np.testing.assert_allclose(np.hstack([by_pose[k], by_drift[k]]), complex_step(f, z), atol=1e-12)


def test_times_are_reduced_to_the_mean_of_their_group_and_sequence_stands_in_for_them() -> None:
    time = np.array([10.0, 14.0, 100.0, np.nan])
    sequence = np.array([1.0, 2.0, 3.0, 5.0])
    found = group_times(time, sequence, np.array(["a", "a", "b", "b"]))
    assert found.tolist() == [-2.0, 2.0, -1.0, 1.0]
    assert group_times(time[2:3], sequence[2:3], np.array(["b"])).tolist() == [0.0]


def test_a_group_of_one_time_has_a_shift_and_no_drift() -> None:
    rng = np.random.default_rng(0)
    group, time = np.array(["a", "b", "b"]), np.array([0.0, -1.0, 1.0])
    (o,) = observed_positions(_positions(rng, 3), np.zeros(3), np.array(list("abc")), None, [drift_term(group, time)])
    (u,) = o.unknowns
    assert list(u.ids) == ["a", "b"]
    assert u.free.tolist() == [[True] * 3 + [False] * 3, [True] * 6]
