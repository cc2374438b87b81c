"""Places by rays of known directions: two strips that share one point, each with one control point."""

import time

import numpy as np
import pytest

from aatri.geometry.known_rotations import DirectedRays, ObservedPlaces, places_by_rays
from aatri.geometry.vectors import unit

CENTRES = np.array([[0, 0, 500], [300, 10, 510], [600, -5, 495], [0, 400, 505], [300, 395, 490], [600, 410, 500.0]])
POINTS = np.array([[50, -90, 3], [150, -20, 10], [450, 30, 5], [350, 200, 0], [60, 450, 8], [420, 500, 2.0]])
SEEN = {0: (0, 1, 3), 1: (0, 1, 2, 3), 2: (1, 2, 3), 3: (3, 4, 5), 4: (3, 4, 5), 5: (4, 5)}
"""Points of each centre; the first three are one strip, which shares point 3 with the other."""


def rays_of(noise_rad: float = 0.0) -> DirectedRays:
    centre, point = np.array([(k, 6 + p) for k, points in SEEN.items() for p in points]).T
    places = np.concatenate([CENTRES, POINTS])
    noise = np.random.default_rng(3).normal(0.0, noise_rad, (len(centre), 3))
    return DirectedRays(centre, point, unit(unit(places[point] - places[centre]) + noise), np.full(len(centre), 1e-4))


def known_points(*points: int) -> ObservedPlaces:
    rows = np.array(points)
    return ObservedPlaces(6 + rows, POINTS[rows], np.full((len(rows), 3), 0.01))


def test_strips_of_one_control_point_each_are_placed_by_the_point_they_share() -> None:
    xyz, _ = places_by_rays(rays_of(), known_points(0, 5), 12)
    assert np.allclose(xyz, np.concatenate([CENTRES, POINTS]), atol=1e-4)


def test_places_are_off_by_what_their_covariances_say() -> None:
    xyz, covariance = places_by_rays(rays_of(1e-4), known_points(0, 5), 12)
    off, sigma = np.abs(xyz - np.concatenate([CENTRES, POINTS])), np.sqrt(np.einsum("nii->ni", covariance))
    assert (off < 5 * sigma).all()
    assert sigma.max() < 5.0


def test_a_single_ray_to_control_gives_the_scale() -> None:
    rays = rays_of()
    others = (rays.centre < 3) & ~((rays.point == 8) & (rays.centre == 1))
    strip = DirectedRays(rays.centre[others], rays.point[others], rays.direction[others], rays.sigma_rad[others])
    xyz, _ = places_by_rays(strip, known_points(0, 2), 12)
    assert np.allclose(xyz[:3], CENTRES[:3], atol=1e-4)


def test_without_a_scale_nothing_is_placed() -> None:
    xyz, _ = places_by_rays(rays_of(), known_points(0), 12)
    assert np.isnan(np.delete(xyz, 6, axis=0)).all()


def test_one_wrong_direction_does_not_move_the_others() -> None:
    rays = rays_of()
    rays.direction[2] = unit(rays.direction[2] + np.array([0.02, 0.0, 0.0]))
    xyz, _ = places_by_rays(rays, known_points(0, 2, 3, 5), 12)
    off = np.abs(xyz - np.concatenate([CENTRES, POINTS]))
    assert np.isfinite(off[1:6]).all()
    assert np.nanmax(off) < 1e-3


def test_a_strip_of_no_scale_beside_placed_ones_is_left_out_and_harms_none() -> None:
    rays, shift = rays_of(1e-5), 12
    beside = [np.concatenate([ends, ends + shift]) for ends in (rays.centre, rays.point)]
    both = DirectedRays(*beside, np.tile(rays.direction, (2, 1)), np.tile(rays.sigma_rad, 2))
    control = ObservedPlaces(np.array([6, 11, 18]), POINTS[[0, 5, 0]], np.full((3, 3), 0.01))
    xyz, _ = places_by_rays(both, control, 24)
    assert np.allclose(xyz[:12], np.concatenate([CENTRES, POINTS]), atol=2.0)
    assert np.isnan(np.delete(xyz[12:], 6, axis=0)).all()


def test_exact_directions_count_as_sharp_ones() -> None:
    rays = rays_of(1e-6)
    rays.sigma_rad[:] = 0.0
    xyz, _ = places_by_rays(rays, known_points(0, 5), 12)
    assert np.allclose(xyz, np.concatenate([CENTRES, POINTS]), atol=0.1)


@pytest.mark.parametrize("points", [2000, 21_000])
def test_many_points_take_no_more_time_than_their_rays_or_are_left(points: int) -> None:
    """Before points were eliminated 2000 of them took 18 s."""
    rng = np.random.default_rng(4)
    centres = np.array([[300.0 * i, 400.0 * j, 500.0] for i in range(7) for j in range(7)]) + rng.normal(0, 8, (49, 3))
    xyz_m = rng.uniform((-100, -100, 0), (1900, 2500, 60), (points, 3))
    away = np.linalg.norm(xyz_m[:, None, :2] - centres[:, :2], axis=2)
    centre, point = np.argsort(away, axis=1)[:, :5].ravel(), np.repeat(np.arange(points), 5)
    direction = unit(unit(xyz_m[point] - centres[centre]) + rng.normal(0, 1e-4, (len(point), 3)))
    rays = DirectedRays(centre, 49 + point, direction, np.full(len(point), 1e-4))
    observed = ObservedPlaces(49 + np.arange(6), xyz_m[:6], np.full((6, 3), 0.02))
    begun_s = time.process_time()
    places, covariance = places_by_rays(rays, observed, 49 + points)
    assert time.process_time() - begun_s < 5.0
    assert rays.few_enough == (points <= 20_000) == np.isfinite(places).all()
    if rays.few_enough:
        off, sigma = np.abs(places[:49] - centres), np.sqrt(np.einsum("nii->ni", covariance[:49]))
        assert (off < 5 * sigma).all()
        assert sigma.max() < 0.5
