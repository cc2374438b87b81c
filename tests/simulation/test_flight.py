"""Flights: stations off their plan, arrangements that are no strips, what their cameras see."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.artifacts.block import Block
from aatri.simulation.flight import FlightPlan, flown
from aatri.simulation.settings import CameraOptions, FlightOptions
from aatri.stages.block.simulate import SimulateOptions, simulate

HEADINGS_DEG = (0.0, 90.0, 180.0, -90.0, 37.0)


def _deviations(position_sigma_m: tuple[float, float, float]) -> np.ndarray:
    """Of the stations from their plan, in m."""
    n, heading = 200 * len(HEADINGS_DEG), np.deg2rad(np.repeat(HEADINGS_DEG, 200))
    ids = [str(k) for k in range(n)]
    plan = FlightPlan(ids, ids, np.arange(n), np.arange(n), heading, np.zeros((n, 3)), 100.0, 500.0)
    flight = FlightOptions(position_sigma_m=position_sigma_m)
    return flown(plan, flight, CameraOptions(), np.random.default_rng(1))[0].reshape(len(HEADINGS_DEG), 200, 3)


@pytest.mark.parametrize(("axis", "turned_deg"), [(0, 0.0), (1, 90.0)])
def test_stations_deviate_along_and_across_their_direction_of_flight(axis: int, turned_deg: float) -> None:
    sigma = [0.0, 0.0, 0.0]
    sigma[axis] = 4.0
    for heading, off in zip(HEADINGS_DEG, _deviations((sigma[0], sigma[1], sigma[2]))):
        angle = np.deg2rad(heading + turned_deg)
        direction = np.array([np.cos(angle), np.sin(angle), 0.0])
        size = off @ direction
        np.testing.assert_allclose(off, size[:, None] * direction, atol=1e-12)
        assert 3.0 < size.std() < 5.0  # 4 m within five standard deviations of the estimate from 200


def test_stations_deviate_in_height() -> None:
    off = _deviations((0.0, 0.0, 4.0))
    np.testing.assert_array_equal(off[..., :2], 0.0)
    assert 3.5 < off[..., 2].std() < 4.5


def made(seed: int = 1, **given: object) -> Block:
    return simulate(options=SimulateOptions.model_validate(given), rng=np.random.default_rng(seed))


STEADY = {"position_sigma_m": (0.0, 0.0, 0.0), "tilt_sigma_deg": 0.0, "kappa_sigma_deg": 0.0}


def test_all_stations_of_an_orbit_look_at_its_middle_from_the_same_distance() -> None:
    block = made(preset="orbit", flight=STEADY)
    true = block.true_images
    assert true is not None
    middle = np.array([0.0, 0.0, 120.0])
    to = middle - true.position_m
    distance = np.linalg.norm(to, axis=1)
    np.testing.assert_allclose(distance, 8.8e-3 * 9000, rtol=1e-9)
    np.testing.assert_allclose(-true.ground_from_image[:, :, 2], to / distance[:, None], atol=1e-9)
    assert (true.ground_from_image[:, 2, 1] > 0).all()  # the image's y looks up
    np.testing.assert_allclose(true.ground_from_image[:, 2, 0], 0, atol=1e-9)  # its x is level


def test_five_heads_look_down_ahead_back_and_to_both_sides() -> None:
    block = made(preset="oblique", flight={**STEADY, "strips": 2, "images_per_strip": 3, "five_heads_deg": 40.0})
    true = block.true_images
    assert true is not None
    views = {str(i): -R[:, 2] for i, R in zip(block.images.id, true.ground_from_image)}
    s, c = np.sin(np.deg2rad(40)), np.cos(np.deg2rad(40))
    for head, view in {"N": (0, 0, -1), "F": (s, 0, -c), "B": (-s, 0, -c), "L": (0, s, -c), "R": (0, -s, -c)}.items():
        np.testing.assert_allclose(views[f"0101{head}"], view, atol=1e-9)  # the first strip is flown to the east
    np.testing.assert_allclose(views["0201F"], (-s, 0, -c), atol=1e-9)
    assert len(block.images) == 30


def test_a_hovering_camera_takes_its_images_from_nearly_one_place() -> None:
    block = made(preset="hover")
    true = block.true_images
    assert true is not None
    places = true.position_m.reshape(9, 4, 3)
    assert np.linalg.norm(places - places.mean(axis=1, keepdims=True), axis=2).max() < 2.0
    apart = np.linalg.norm(places.mean(axis=1)[:, None] - places.mean(axis=1)[None], axis=2)
    assert apart[apart > 0].min() > 25.0


@pytest.mark.parametrize("preset", ["orbit", "oblique", "hover"])
def test_image_points_are_where_the_truth_puts_them(preset: str) -> None:
    block = made(preset=preset, noise=False, camera={"distortion": "none"})
    m, true, points = block.image_points, block.true_images, block.true_points
    assert true is not None
    assert points is not None
    assert np.isclose(np.linalg.det(true.ground_from_image), 1).all()
    X = points.xyz_m[m.point] - true.position_m[m.image]
    u = Rotation.from_matrix(true.ground_from_image[m.image]).inv().apply(X)
    c, pixel = 8.8, 0.0024
    x = -c * u[:, 0] / u[:, 2] + block.cameras.principal_point_mm[0, 0]
    y = -c * u[:, 1] / u[:, 2] + block.cameras.principal_point_mm[0, 1]
    np.testing.assert_allclose(m.xy, np.column_stack([x / pixel + 2736, 1824 - y / pixel]), atol=1e-6)
    assert np.bincount(m.image, minlength=len(block.images)).min() >= 8
