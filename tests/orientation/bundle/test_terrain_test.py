"""Points of two rays against the terrain around them: hills, rough ground, houses; what is told, and what never."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.checks.after.terrain import points_off_the_terrain
from aatri.orientation.bundle.adjust import adjust_bundle
from aatri.orientation.bundle.terrain_test import off_terrain
from tests.orientation.bundle.made_bundle import made_bundle
from tests.orientation.bundle.parts import settings

GROUND = ("hills", "rough", "houses")


def _terrain(kind: str, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """400 points of a square kilometre, and their rays: a third has two."""
    n = 400
    xy = rng.uniform(0, 1000, (n, 2))
    z = 10 * np.sin(xy[:, 0] / 150) * np.cos(xy[:, 1] / 200)
    z += rng.normal(0, 2, n) if kind == "rough" else 0.0
    z += np.where(rng.random(n) < 0.1, rng.uniform(3, 15, n), 0) if kind == "houses" else 0.0
    return np.column_stack([xy, z]), np.where(rng.random(n) < 0.3, 2, 4)


@pytest.mark.parametrize("kind", GROUND)
def test_terrain_as_it_is_is_never_told(kind: str) -> None:
    for seed in range(20):
        xyz, rays = _terrain(kind, np.random.default_rng(seed))
        assert not len(off_terrain(xyz, np.full(len(xyz), 0.05), rays, 1000.0).row)


@pytest.mark.parametrize(("kind", "off_m"), [("hills", 30.0), ("rough", 40.0), ("houses", -90.0)])
def test_a_point_of_two_rays_far_off_is_told_with_its_height(kind: str, off_m: float) -> None:
    found = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        xyz, rays = _terrain(kind, rng)
        wrong = int(rng.choice(np.flatnonzero(rays == 2)))
        xyz[wrong, 2] += off_m
        told = off_terrain(xyz, np.full(len(xyz), 0.05), rays, 1000.0)
        assert set(told.row.tolist()) <= {wrong}
        found += len(told.row)
        assert np.allclose(told.height_m, off_m, atol=16.0)
    assert found >= 18


def test_the_statistic_counts_standard_deviations_of_the_ground_around() -> None:
    """Ground rough by 2 m: s is 2 m, or more where it is rougher around the point; the cofactor of a mean of 12."""
    counted = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        xyz, rays = np.column_stack([rng.uniform(0, 1000, (400, 2)), rng.normal(0, 2, 400)]), np.full(400, 4)
        xyz[3], rays[3] = [500.0, 500.0, 60.0], 2
        told = off_terrain(xyz, np.full(400, 0.05), rays, 1000.0)
        assert told.row.tolist() == [3]
        counted.append(told.test[0] * 2.0 * np.sqrt(1 + 1 / 12) / told.height_m[0])
    assert 0.75 < np.median(counted) < 1.05


def test_a_point_of_more_rays_is_told_only_where_no_terrain_is() -> None:
    xyz, rays = _terrain("hills", np.random.default_rng(1))
    rays[:] = 4
    for off_m, told in ((40.0, False), (-300.0, True)):
        moved = xyz.copy()
        moved[7, 2] += off_m
        assert (7 in off_terrain(moved, np.full(len(xyz), 0.05), rays, 1000.0).row) == told


def test_without_enough_tested_points_there_is_no_terrain() -> None:
    xyz, rays = _terrain("hills", np.random.default_rng(1))
    xyz[5, 2] += 500.0
    assert not len(off_terrain(xyz, np.full(len(xyz), 0.05), np.full(len(rays), 2), 1000.0).row)


@pytest.mark.parametrize(("off_m", "told"), [(-800.0, True), (-400.0, False), (700.0, True)])
def test_a_point_of_two_rays_outside_of_the_block_is_told_far_beyond_all_others(off_m: float, told: bool) -> None:
    xyz, rays = _terrain("hills", np.random.default_rng(1))
    xyz[9], rays[9] = [1900.0, 1500.0, off_m], 2
    outside = off_terrain(xyz, np.full(len(xyz), 5.0), rays, 1000.0)
    assert outside.row.tolist() == [9] * told
    np.testing.assert_allclose(outside.height_m, off_m, atol=11.0)
    assert not len(off_terrain(xyz, np.full(len(xyz), 5.0), rays, 5.0).row)  # around an object, not above it
    xyz[9, 2] = -2e5  # all but parallel rays, as uncertain as far away
    assert not len(off_terrain(xyz, np.where(np.arange(len(xyz)) == 9, 1e5, 5.0), rays, 1000.0).row)


def test_what_images_see_from_the_side_is_held_against_no_terrain() -> None:
    """A wall, a column: its points stand above each other, and one alone there is no error."""
    xyz, rays = _terrain("hills", np.random.default_rng(4))
    xyz[7, 2], rays[7] = 80.0, 2
    sigma_m = np.full(len(xyz), 0.005)
    assert off_terrain(xyz, sigma_m, rays, 1000.0, downwards=0.7).row.tolist() == [7]
    assert not len(off_terrain(xyz, sigma_m, rays, 1000.0, downwards=0.1).row)


@pytest.mark.filterwarnings("error")
def test_without_adjusted_points_no_terrain_is_tested() -> None:
    block = made_bundle().together()
    result = adjust_bundle(block, settings(datum="free"))
    unadjusted = replace(result, point_adjusted=np.zeros_like(result.point_adjusted))
    assert points_off_the_terrain(block, unadjusted) == []
