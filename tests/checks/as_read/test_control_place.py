"""Control off the block: found before adjusting, and nothing legal is."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.checks.as_read.control_place import misplaced_control

MAP = np.array([446_000.0, 4_505_000.0])
STATIONS = MAP + np.array([[x, y] for y in (0.0, 800.0) for x in (0.0, 500.0, 1000.0, 1500.0)])
POINTS = MAP + np.array([[50.0, 80.0], [1450.0, 30.0], [700.0, 400.0], [60.0, 790.0], [1420.0, 820.0]])
IDS = [f"GCP{k + 1}" for k in range(len(POINTS))]


def _rays(points=POINTS, stations=STATIONS, reach=900.0):
    near = np.linalg.norm(points[:, None] - stations[None], axis=2) < reach
    return np.nonzero(near)


RAYS = _rays()


def _found(points, stations=STATIONS, rays=RAYS, ids=IDS):
    flat, above = (np.column_stack([xy, np.full(len(xy), z)]) for xy, z in ((points, 10.0), (stations, 700.0)))
    return misplaced_control(ids, flat, above, *rays, [f"control.csv:{k + 2}" for k in range(len(points))])


def test_good_control_is_left_alone_with_and_without_positions() -> None:
    assert _found(POINTS) == []
    assert _found(POINTS, np.full_like(STATIONS, np.nan)) == []


def test_two_near_points_among_four_say_nothing_against_the_others() -> None:
    """Two control points 3 m apart, two a kilometre away, no positions: the middle of three is one of the near ones."""
    points = MAP + np.array([[0.0, 0.0], [2.0, 2.2], [1000.0, 30.0], [40.0, 900.0]])
    control = np.arange(4)
    assert _found(points, np.full_like(STATIONS, np.nan), (control, control), IDS[:4]) == []


def test_of_three_points_one_in_another_unit_is_named_and_one_that_is_far_is_not() -> None:
    """Three points around an object, no positions; a long strip with two points at its one end."""
    control, nowhere = np.arange(3), np.full_like(STATIONS, np.nan)
    object_points = np.array([[100.2, 31.8], [134.4, 31.6], [116.6, 44.0]])
    assert _found(object_points, nowhere, (control, control), IDS[:3]) == []
    mixed = object_points * [[1000.0], [1.0], [1.0]]
    (found,) = _found(mixed, nowhere, (control, control), IDS[:3])
    assert (found.level, found.where) == ("error", "control.csv:2")
    assert "divided by 1000 it would lie inside" in found.sentence
    two_near = np.array([[32.335, 36.058], [31.782, 34.970], [31.906, 35.074]])  # no change brings the first nearer
    assert _found(two_near, nowhere, (control, control), IDS[:3]) == []
    strip = MAP + np.array([[0.0, 0.0], [15.0, 20.0], [9_000.0, 40.0]])
    assert _found(strip, nowhere, (control, control), IDS[:3]) == []


@pytest.mark.parametrize("positions", [True, False])
def test_one_point_with_x_and_y_swapped_is_named_with_its_distance(positions: bool) -> None:
    local = POINTS - MAP + np.array([3000.0, 9000.0])
    stations = STATIONS - MAP + np.array([3000.0, 9000.0]) if positions else np.full_like(STATIONS, np.nan)
    local[1] = local[1, ::-1]
    (found,) = _found(local, stations)
    assert found.level == "error"
    assert found.where == "control.csv:3"
    assert "GCP2 lies" in found.sentence
    assert "km from the block; with X and Y exchanged it would lie inside" in found.sentence


def test_a_point_far_off_for_no_known_reason_is_a_warning() -> None:
    moved = POINTS.copy()
    moved[2] += [0.0, 7_400.0]
    (found,) = _found(moved)
    assert found.level == "warning"
    assert "GCP3 lies 7" in found.sentence


@pytest.mark.parametrize("wrong", [[0.0, 7_400.0], [-401_400.0, 0.0], [0.0, 300_000.0]])
def test_a_wrong_position_is_no_reason_to_doubt_the_control_that_its_image_shows(wrong: list[float]) -> None:
    """Every control point is seen from another image too; one has lost a digit of its easting."""
    stations = STATIONS.copy()
    stations[1] += wrong
    control, image = RAYS
    assert all((image[control == k] != 1).any() for k in range(len(POINTS)))
    assert _found(POINTS, stations) == []


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
        (lambda p: p / 1000, "; times 1000 it would lie inside", "metres"),
        (lambda p: p * 1000, "; divided by 1000 it would lie inside", "metres"),
        (lambda p: p * 100, "; divided by 100 it would lie inside", "metres"),
        (lambda p: p + np.array([150e3, 0]), "km from the block, the others", "its id"),
    ],
)
def test_one_point_of_another_unit_or_zone_stops_the_run(change, what: str, remedy: str, positions: bool) -> None:
    moved = POINTS.copy()
    moved[2] = change(moved[2])
    (found,) = _found(moved, STATIONS if positions else np.full_like(STATIONS, np.nan))
    assert found.level == "error"
    assert found.where == "control.csv:4"
    assert what in found.sentence
    assert remedy in found.remedy


def test_near_the_origin_another_unit_of_one_point_proves_nothing() -> None:
    local = POINTS - MAP
    local[2] += [0.0, 9_000.0]  # divided by 1000 it would lie inside, and so would all others
    (found,) = _found(local, STATIONS - MAP)
    assert found.level == "warning"


@pytest.mark.parametrize(
    ("change", "what", "remedy"),
    [
        (lambda p: p[:, ::-1], "with X and Y exchanged", "axes"),
        (lambda p: p / 0.3048, "taken as feet", "metres"),
        (lambda p: p * 0.3048, "divided by 0.3048", "metres"),
        (lambda p: p / 1000, "times 1000", "km"),
        (lambda p: p * 1000, "divided by 1000", "mm"),
        (lambda p: p * 100, "divided by 100 ", "cm"),
        (lambda p: p + np.array([50e6, 0]), "without the zone number", "zone number"),
        (lambda p: p + np.array([-430e3, 12e3]), "lie 431 km from the images", "zone"),
    ],
)
def test_all_control_of_another_order_unit_or_zone(change, what: str, remedy: str) -> None:
    (found,) = _found(change(POINTS))
    assert found.level == "error"
    assert found.where == "control.csv:2"
    assert what in found.sentence
    assert remedy in found.remedy


def test_all_control_of_a_corridor_in_the_other_order_is_named_however_long_it_is() -> None:
    """Six kilometres of it, three to four from the images that show it."""
    stations = np.column_stack([np.linspace(2000.0, 8000.0, 31), np.full(31, 9000.0)])
    points = stations[[0, 10, 20, 25]] + [50.0, 80.0]
    rays = _rays(points, stations, 300.0)
    assert _found(points, stations, rays, IDS[:4]) == []
    (found,) = _found(points[:, ::-1], stations, rays, IDS[:4])
    assert found.level == "error"
    assert "with X and Y exchanged" in found.sentence


def test_objects_seen_from_afar_are_legal() -> None:
    # three stations at the origin of a local system, targets in one direction, near and far
    stations = np.array([[0.0, 0.0], [0.6, 0.1], [1.1, -0.2]])
    for spread in (0.5, 30.0):
        targets = np.array([90.0, 15.0]) + spread * np.array([[0, 0], [0, 1], [1, 0], [1, 1.0]])
        rays = np.nonzero(np.ones((4, 3)))
        assert all(f.level == "warning" for f in _found(targets, stations, rays, list("ABCD")))


def test_a_facade_that_lies_as_its_stations_with_x_and_y_exchanged_is_legal() -> None:
    stations = np.array([[20.0, 70.0], [20.6, 70.1], [21.1, 69.8]])
    targets = np.array([70.0, 20.0]) + np.array([[-4, 0], [4, 2], [0, 4], [14, -4], [2, -14]])
    rays = np.nonzero(np.ones((5, 3)))
    assert all(f.level == "warning" for f in _found(targets, stations, rays, list("ABCDE")))


def test_points_no_image_shows_are_not_judged() -> None:
    county = np.vstack([POINTS, MAP + np.array([90e3, 40e3])])
    assert _found(county, ids=[*IDS, "K"]) == []


def test_height_only_control_and_images_without_position_are_passed_over() -> None:
    points, stations = POINTS.copy(), STATIONS.copy()
    points[0], stations[1] = np.nan, np.nan
    assert _found(points, stations) == []
