"""The spherical earth: map and tangent frame are of one world."""

import numpy as np

from aatri.simulation import earth
from aatri.stages.block.simulate import SimulateOptions, simulate

R = 6_371_000.0


def both():
    options = {"noise": False, "flight": {"strips": 6, "images_per_strip": 12}}
    return [
        simulate(options=SimulateOptions(earth=kind, **options), rng=np.random.default_rng(5))
        for kind in ("map", "tangent")
    ]


def test_distances_on_the_sphere_are_the_same_from_map_and_tangent_frame() -> None:
    in_map, in_tangent = both()
    m, t = in_map.true_points.xyz_m, in_tangent.true_points.xyz_m + np.array([0.0, 0.0, R])
    np.testing.assert_allclose(np.linalg.norm(t, axis=1) - R, m[:, 2], rtol=0, atol=1e-8)
    direction = t / np.linalg.norm(t, axis=1)[:, None]
    chord = np.linalg.norm(direction[1:] - direction[:-1], axis=1)
    z = (m[:, 0] + 1j * m[:, 1]) / (2 * R)  # closed form of the stereographic chord
    closed = 2 * np.abs(z[1:] - z[:-1]) / np.sqrt((1 + np.abs(z[1:]) ** 2) * (1 + np.abs(z[:-1]) ** 2))
    np.testing.assert_allclose(R * chord, R * closed, rtol=0, atol=1e-8)


def test_both_blocks_hold_the_same_image_points() -> None:
    in_map, in_tangent = both()
    np.testing.assert_array_equal(in_map.image_points.xy, in_tangent.image_points.xy)
    assert (in_map.earth_curvature, in_tangent.earth_curvature) == ("correct", "ignore")


def test_the_axes_of_a_place_are_where_the_coordinates_grow() -> None:
    place = np.array([[2500.0, -1800.0, 300.0], [-40e3, 90e3, 12.0]])
    axes = earth.tangent_from_place(place)
    np.testing.assert_allclose(axes @ axes.swapaxes(1, 2), np.broadcast_to(np.eye(3), (2, 3, 3)), atol=1e-15)
    for k, step in enumerate(np.eye(3)):
        growth = (earth.tangent_from_map(place + step) - earth.tangent_from_map(place - step)) / 2
        np.testing.assert_allclose(growth / np.linalg.norm(growth, axis=1)[:, None], axes[:, :, k], atol=1e-9)


def test_the_map_has_scale_one_at_the_centre() -> None:
    near = earth.tangent_from_map(np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, -10.0, 0.0]]))
    np.testing.assert_allclose(near[:, :2], [[0, 0], [10, 0], [0, -10]], atol=1e-10)


def test_a_rotation_in_the_tangent_frame_is_that_of_the_place_turned() -> None:
    in_map, in_tangent = both()
    axes = earth.tangent_from_place(in_map.true_images.position_m)
    turned = axes @ in_map.true_images.ground_from_image
    np.testing.assert_allclose(turned, in_tangent.true_images.ground_from_image, atol=1e-15)


def test_a_false_origin_adds_exactly() -> None:
    origin = (446000.0, 4505000.0)
    local = earth.settled(np.random.default_rng(1).uniform(-3000, 3000, (1000, 3)), origin)
    given = local + np.array([*origin, 0.0])
    np.testing.assert_array_equal(given - np.array([*origin, 0.0]), local)
