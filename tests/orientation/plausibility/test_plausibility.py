"""Control off the block and cameras that cannot be: found before adjusting, and nothing legal is."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.orientation.plausibility.cameras import Cameras, camera_notes, control_notes, given_notes
from aatri.orientation.plausibility.control import misplaced_control

MAP = np.array([446_000.0, 4_505_000.0])
STATIONS = MAP + np.array([[x, y] for y in (0.0, 800.0) for x in (0.0, 500.0, 1000.0, 1500.0)])
POINTS = MAP + np.array([[50.0, 80.0], [1450.0, 30.0], [700.0, 400.0], [60.0, 790.0], [1420.0, 820.0]])
IDS = [f"GCP{k + 1}" for k in range(len(POINTS))]


def _rays(points=POINTS, stations=STATIONS, reach=900.0):
    near = np.linalg.norm(points[:, None] - stations[None], axis=2) < reach
    return np.nonzero(near)


RAYS = _rays()


def _found(points, stations=STATIONS, rays=RAYS, ids=IDS):
    return misplaced_control(ids, points, stations, *rays)


def test_good_control_is_left_alone_with_and_without_positions():
    assert _found(POINTS) == ()
    assert _found(POINTS, np.full_like(STATIONS, np.nan)) == ()


@pytest.mark.parametrize("positions", [True, False])
def test_one_point_with_x_and_y_swapped_is_named_with_its_distance(positions):
    local = POINTS - MAP + np.array([3000.0, 9000.0])
    stations = STATIONS - MAP + np.array([3000.0, 9000.0]) if positions else np.full_like(STATIONS, np.nan)
    local[1] = local[1, ::-1]
    (found,) = _found(local, stations)
    assert found.certain
    assert found.rows.tolist() == [1]
    assert "GCP2 lies" in found.text
    assert "km from the block; with X and Y swapped it would lie inside" in found.text


def test_a_point_far_off_for_no_known_reason_is_a_warning():
    moved = POINTS.copy()
    moved[2] += [0.0, 7_400.0]
    (found,) = _found(moved)
    assert not found.certain
    assert "GCP3 lies 7" in found.text


@pytest.mark.parametrize("positions", [True, False])
@pytest.mark.parametrize(
    ("change", "what", "remedy"),
    [
        (
            lambda p: p + np.array([39e6, 0]),
            "from the block; without the zone number",
            "zone number",
        ),
        (lambda p: p / 0.3048, "; taken as feet it would lie inside", "metres"),
        (lambda p: p / 1000, "; times 1000 it would lie inside", "this point"),
        (lambda p: p * 1000, "; divided by 1000 it would lie inside", "this point"),
        (lambda p: p + np.array([150e3, 0]), "km from the block, the others", "its id"),
    ],
)
def test_one_point_of_another_unit_or_zone_stops_the_run(change, what, remedy, positions):
    moved = POINTS.copy()
    moved[2] = change(moved[2])
    (found,) = _found(moved, STATIONS if positions else np.full_like(STATIONS, np.nan))
    assert found.certain
    assert found.rows.tolist() == [2]
    assert what in found.text
    assert remedy in found.remedy


def test_near_the_origin_another_unit_of_one_point_proves_nothing():
    local = POINTS - MAP
    local[2] += [0.0, 9_000.0]  # divided by 1000 it would lie inside, and so would all others
    (found,) = _found(local, STATIONS - MAP)
    assert not found.certain


@pytest.mark.parametrize(
    ("change", "what", "remedy"),
    [
        (lambda p: p[:, ::-1], "with X and Y swapped", "axes"),
        (lambda p: p / 0.3048, "taken as feet", "metres"),
        (lambda p: p * 0.3048, "divided by 0.3048", "metres"),
        (lambda p: p / 1000, "times 1000", "km"),
        (lambda p: p * 1000, "divided by 1000", "mm"),
        (lambda p: p + np.array([50e6, 0]), "without the zone number", "zone number"),
        (lambda p: p + np.array([-430e3, 12e3]), "lie 431 km from the images", "zone"),
    ],
)
def test_all_control_of_another_order_unit_or_zone(change, what, remedy):
    (found,) = _found(change(POINTS))
    assert found.certain
    assert found.rows.tolist() == [0, 1, 2, 3, 4]
    assert what in found.text
    assert remedy in found.remedy


def test_objects_seen_from_afar_are_legal():
    # three stations at the origin of a local system, targets in one direction, near and far
    stations = np.array([[0.0, 0.0], [0.6, 0.1], [1.1, -0.2]])
    for spread in (0.5, 30.0):
        targets = np.array([90.0, 15.0]) + spread * np.array([[0, 0], [0, 1], [1, 0], [1, 1.0]])
        rays = np.nonzero(np.ones((4, 3)))
        assert all(not f.certain for f in misplaced_control(list("ABCD"), targets, stations, *rays))


def test_points_no_image_shows_are_not_judged():
    county = np.vstack([POINTS, MAP + np.array([90e3, 40e3])])
    assert misplaced_control([*IDS, "K"], county, STATIONS, *RAYS) == ()


CAMERAS = Cameras(["c"], np.array([150.0]), np.array([[115.0, 115.0]]), np.array([0.02]))


def _block(camera=CAMERAS, unit=1.0):
    position = np.column_stack([STATIONS, np.full(len(STATIONS), 760.0)])
    rotation = np.tile(np.eye(3), (len(position), 1, 1))
    xyz = np.column_stack([POINTS, [10.0, 12.0, 8.0, 9.0, 11.0]]) * [1, 1, unit]
    point, image = _rays(reach=500.0)
    return camera, np.zeros(len(position), int), position, rotation, xyz, image, point


def test_a_line_per_camera_tells_field_of_view_height_scale_and_sampling():
    (note,) = camera_notes(*_block())
    # 2 atan(115 sqrt(2) / 150) = 94.6 deg; 750 m over ground at c = 150 mm: 1 : 5,000, 0.02 mm are 0.1 m
    assert str(note) == (
        "camera c: field of view 94.6 deg, 750 m above its points, scale 1 : 5,000, ground sampling distance 0.1 m"
    )


def test_a_line_per_camera_tells_what_is_given_and_nothing_of_a_camera_of_which_nothing_is():
    bare = Cameras(["c", "bare"], np.array([150.0, np.nan]), np.array([[115.0, 115.0], [np.nan, np.nan]]),
                   np.array([0.02, np.nan]))  # fmt: skip
    (note,) = given_notes(bare, np.zeros(3, dtype=int), np.array([740.0, 750.0, 760.0]))
    assert str(note) == (
        "camera c, as given: 750 m from the control it shows, field of view 94.6 deg, scale 1 : 5,000, "
        "ground sampling distance 0.1 m"
    )


@pytest.mark.parametrize(
    ("camera", "what"),
    [
        (Cameras(["c"], np.array([0.15]), np.array([[115.0, 115.0]]), np.array([0.02])), "field of view of 180"),
        (Cameras(["c"], np.array([150000.0]), np.array([[115.0, 115.0]]), np.array([0.02])), "field of view of 0.12"),
        (
            Cameras(["c"], np.array([150.0]), np.array([[115.0, 115.0]]), np.array([21.0])),
            "ground sampling distance of 105 m",
        ),
    ],
)
def test_wrong_camera_constants_are_warnings(camera, what):
    notes = camera_notes(*_block(camera))
    assert any(note.level == "warning" and what in note.text for note in notes)


def test_cameras_below_their_points_that_look_up_are_warned_of():
    cameras, camera, position, _, xyz, image, point = _block()
    upwards = np.diag([1.0, -1.0, -1.0])
    turned = (position * [1, 1, -1], np.tile(upwards, (len(position), 1, 1)), xyz * [1, 1, -1])
    notes = camera_notes(cameras, camera, *turned, image, point)
    assert [note for note in notes if note.level == "warning" and "look up at points above them" in note.text]
    assert not [note for note in camera_notes(*_block()) if note.level == "warning"]


def test_a_scale_that_no_film_has_is_warned_of():
    film = Cameras(["c"], np.array([150.0]), np.array([[115.0, 115.0]]), np.array([np.nan]))
    zero = np.zeros(3, dtype=int)
    notes = given_notes(film, zero, np.full(3, 450e3))
    assert [note for note in notes if note.level == "warning" and "scale of 1 : 3,000,000" in note.text]
    assert not [note for note in given_notes(film, zero, np.full(3, 250e3)) if note.level == "warning"]


def test_heights_in_feet_put_points_behind_the_camera():
    notes = camera_notes(*_block(unit=100.0))
    assert any("lie behind it" in note.text for note in notes if note.level == "warning")


def test_control_outside_of_what_its_images_show_is_named():
    _, camera, position, rotation, xyz, image, point = _block()
    good = control_notes(CAMERAS, camera, position, rotation, IDS, xyz, image, point)
    assert [str(n) for n in good] == ["5 of 5 control points lie in what their images show"]
    wrong = xyz.copy()
    wrong[3, 1] += 7_400.0
    line, warning = control_notes(CAMERAS, camera, position, rotation, IDS, wrong, image, point)
    assert str(line).startswith("4 of 5")
    assert warning.level == "warning"
    assert warning.ids == ("GCP4 (7.39 km from the nearest of them)",)


def test_height_only_control_and_images_without_position_are_passed_over():
    points, stations = POINTS.copy(), STATIONS.copy()
    points[0], stations[1] = np.nan, np.nan
    assert _found(points, stations) == ()
