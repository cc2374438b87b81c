"""Resection of images with few points: what is accepted, what only chance explains, what nothing tells apart."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.geometry.rotations import exp_rotation
from aatri.orientation.resection.start import start_orientation

C_MM, AREA_MM2 = 150.0, 200.0**2


def _seen(seed: int, xyz: np.ndarray):
    """A camera 1000 m above points, tilted by some degrees, and what it sees of them, to 5 um."""
    rng = np.random.default_rng(seed)
    R, X0 = exp_rotation(rng.normal(0, 0.1, 3)), np.array([*rng.normal(0, 100, 2), 1000.0])
    u = (xyz - X0) @ R
    return X0, R, -C_MM * u[:, :2] / u[:, 2:] + rng.normal(0, 0.005, (len(xyz), 2))


@pytest.mark.parametrize("seed", range(10))
def test_four_points_of_which_three_are_collinear_orient_an_image(seed: int) -> None:
    xyz = np.array([[-400.0, -300, 10], [0, -290, 20], [400, -280, 30], [-50, 380, 60]])
    X0, R, xy = _seen(seed, xyz)
    found = start_orientation(xy, C_MM, xyz, area_mm2=AREA_MM2)
    assert found is not None
    assert np.linalg.norm(found[0] - X0) < 2.0
    np.testing.assert_allclose(found[1], R, atol=2e-3)


@pytest.mark.parametrize("n", [4, 5, 6, 20])
def test_points_with_wrong_numbers_give_no_orientation(n: int) -> None:
    """Once in a thousand images one may be accepted by chance."""
    accepted = 0
    for seed in range(60):
        xyz = np.random.default_rng(seed).uniform([-500, -500, 0], [500, 500, 80], (n, 3))
        xy = _seen(seed, xyz)[2]
        accepted += start_orientation(np.roll(xy, 1, axis=0), C_MM, xyz, area_mm2=AREA_MM2) is not None
    assert accepted <= 1


@pytest.mark.slow
@pytest.mark.parametrize("n", [4, 5, 6, 20])
def test_right_numbers_give_the_orientation(n: int) -> None:
    """Four points may leave two orientations that nothing tells apart, and a start is none then; never a wrong one."""
    none = 0
    for seed in range(60):
        xyz = np.random.default_rng(seed).uniform([-500, -500, 0], [500, 500, 80], (n, 3))
        X0, _, xy = _seen(seed, xyz)
        found = start_orientation(xy, C_MM, xyz, area_mm2=AREA_MM2)
        none += found is None
        assert found is None or np.linalg.norm(found[0] - X0) < 50.0
    assert none <= (6 if n < 6 else 0)


def test_a_known_projection_centre_makes_three_points_enough() -> None:
    xyz = np.array([[-400.0, -300, 10], [400, -280, 30], [-50, 380, 60]])
    X0, R, xy = _seen(3, xyz)
    unknown = np.full((3, 3), np.nan)
    assert start_orientation(xy, C_MM, xyz, area_mm2=AREA_MM2) is None
    found = start_orientation(xy, C_MM, xyz, area_mm2=AREA_MM2, offered=(X0 + 0.5, unknown))
    assert found is not None
    np.testing.assert_allclose(found[1], R, atol=2e-3)
    assert start_orientation(xy, C_MM, xyz, area_mm2=AREA_MM2, offered=(X0 + 300.0, unknown)) is None


def test_an_orientation_that_is_offered_is_tested_too() -> None:
    xyz = np.array([[-400.0, -300, 10], [400, -280, 30]])
    X0, R, xy = _seen(4, xyz)
    found = start_orientation(xy, C_MM, xyz, area_mm2=AREA_MM2, offered=(X0, R))
    assert found is not None
    assert start_orientation(xy, C_MM, xyz, area_mm2=AREA_MM2, offered=(X0, exp_rotation([0, 0, 1.0]) @ R)) is None
