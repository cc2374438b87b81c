"""Bodies that begin together: which are tried, which are determined, and what contradicts the others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.geometry.similarity import Similarity, inverse, transform
from aatri.observations.control import known_at, observed_control
from aatri.observations.observed import Observed
from aatri.observations.poses import Poses
from aatri.orientation.bodies.datum_start import Observe
from aatri.orientation.bodies.free_body import FreeBody, concerning
from aatri.orientation.bodies.joint_start import MOST, joint_start

SIGMA_M = 0.05
IMAGES_M = np.array([[0.0, 0, 500], [300, 10, 510], [600, -10, 495]])


def on_the_ground(number: int) -> Similarity:
    """Ground from body."""
    turn = Rotation.from_euler("xyz", [0.02 * number, -0.03, 0.9 * number]).as_matrix()
    return Similarity(np.array([200.0 * number, 50, 3]), 100.0 + 20 * number, turn)


def ground_points(count: int) -> np.ndarray:
    rng = np.random.default_rng(5)
    return np.column_stack([rng.uniform(0, 600, count), rng.uniform(-300, 300, count), rng.uniform(0, 60, count)])


def body(number: int, xyz_m: np.ndarray, points: Sequence[int], sigma_m: float = SIGMA_M) -> FreeBody:
    """A body with these points, and images of its own."""
    back = inverse(on_the_ground(number))
    xyz = np.full(xyz_m.shape, np.nan)
    xyz[points] = transform(back, xyz_m[points])
    covariance = np.tile((sigma_m * back.scale) ** 2 * np.eye(3), (len(xyz), 1, 1))
    looking_down = np.tile(back.rotation, (3, 1, 1))
    return FreeBody(Poses(transform(back, IMAGES_M), looking_down), xyz, covariance, covariance[:3], 1e-4)


def observing(one: FreeBody, observed: Sequence[Observed]) -> Observe:
    own = concerning(observed, one)
    return lambda _: own


def control(xyz_m: np.ndarray, points: Sequence[int]) -> Sequence[Observed]:
    ids = np.array([str(p) for p in points])
    return observed_control(known_at(np.array(points), xyz_m[points], 4e-4 * np.eye(3)), np.zeros(3), ids)


def begun(bodies: Sequence[FreeBody], observed: Sequence[Observed]) -> tuple[list[int], list[int], float]:
    """Bodies that were tried, those that are determined, and how far points of these are off, m."""
    group, to = joint_start(bodies, [observing(one, observed) for one in bodies])
    X = ground_points(len(bodies[0].xyz))
    off_m = [np.linalg.norm(transform(s, bodies[k].xyz) - X, axis=1) for k, s in to.items()]
    return group, sorted(to), float(np.nanmax(off_m)) if off_m else float("nan")


def test_a_chain_of_bodies_with_one_point_in_common_each_is_not_tried() -> None:
    """By hand: the last has three conditions and seven unknowns; without it the one before has. 20 s when tried."""
    X = ground_points(60)
    bodies = [body(k, X, [k, k + 1, *range(20 + k, 60, 16)]) for k in range(16)]
    assert begun(bodies, ())[:2] == (list(range(16)), [])


@pytest.mark.slow
def test_a_body_that_hangs_by_one_point_costs_the_others_nothing() -> None:
    X = ground_points(30)
    points = [range(9), [3, 4, 5, 6, 7, 8, 10, 11, 12], [10, 11, 12, 13], [13, 14, 15]]
    group, determined, off_m = begun([body(k, X, p) for k, p in enumerate(points)], control(X, [0, 1, 2]))
    assert sorted(group) == determined == [0, 1, 2]
    assert off_m < 0.01


def test_exact_points_in_common_are_weighed() -> None:
    X = ground_points(12)
    bodies = [body(k, X, p, sigma_m=0.0) for k, p in enumerate((range(8), range(4, 12)))]
    _, determined, off_m = begun(bodies, control(X, [0, 1, 2, 3]))
    assert determined == [0, 1]
    assert off_m < 1e-3


@pytest.mark.slow
def test_a_body_that_contradicts_the_others_has_no_part() -> None:
    X = ground_points(24)
    bodies = [body(k, X, p) for k, p in enumerate((range(14), range(4, 9), range(9, 14)))]
    bodies[1].xyz[4:9] = np.roll(bodies[1].xyz[4:9], 2, axis=0)
    _, determined, off_m = begun(bodies, control(X, [0, 1, 2, 3]))
    assert determined == [0, 2]
    assert off_m < 0.01


@pytest.mark.slow
def test_no_more_are_tried_together_than_stated() -> None:
    X = ground_points(60)
    bodies = [body(k, X, range(4 * k, 4 * k + 8)) for k in range(MOST + 2)]
    group, determined, off_m = begun(bodies, control(X, [0, 1, 2, 3]))
    assert sorted(group) == determined == list(range(MOST))
    assert off_m < 0.01
