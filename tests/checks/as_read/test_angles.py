"""Angles between rays: good blocks say nothing, each cause is named, and what is legal is left alone.

Images come from a plain central projection of stations turned at random, which the code under test knows nothing of.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.checks.as_read.angles import Contradiction, angles_that_differ, contradiction
from aatri.checks.as_read.control_rays import ControlRays, photo_mm
from aatri.checks.as_read.positions import impossible_positions
from aatri.errors import InputError
from aatri.formats.tables.reader import read_block
from tests.reading import read_block as block_of_folder
from tests.small_blocks import flown

C_MM = 100.0
ORIGIN = np.array([5000.0, 9000.0, 100.0])


def _rays(height: float = 800.0, seed: int = 4, error_m: float = 0.0) -> ControlRays:
    chance = np.random.default_rng(seed)
    station = np.array([[x, y, height] for y in (0.0, 700.0) for x in (0.0, 400.0, 800.0)]) + ORIGIN
    station += chance.normal(0, 0.02 * height, station.shape)
    control = np.array([[x, y, 0.0] for y in (-200.0, 350.0, 900.0) for x in (-200.0, 400.0, 1000.0)])
    control += ORIGIN + chance.uniform(0, 60, control.shape)
    rows = []
    for i, x0 in enumerate(station):
        omega, phi, kappa = [*chance.uniform(-0.1, 0.1, 2), chance.uniform(-3, 3)]
        turn = _about(0, omega) @ _about(1, phi) @ _about(2, kappa)
        u = (control - x0) @ turn
        xy = -C_MM * u[:, :2] / u[:, 2:]
        rows += [(i, k, *xy[k]) for k in np.flatnonzero((np.abs(xy) < 110).all(axis=1))]
    table = np.array(rows)
    image, point = table[:, 0].astype(int), table[:, 1].astype(int)
    return ControlRays(
        image,
        point,
        table[:, 2:],
        np.zeros((len(table), 2)),
        np.full(len(table), C_MM),
        station + chance.normal(0, error_m, station.shape),
        control,
    )


def _about(axis: int, angle: float) -> np.ndarray:
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    turn = np.eye(3)
    turn[[i, j], [i, j]], turn[i, j], turn[j, i] = np.cos(angle), -np.sin(angle), np.sin(angle)
    return turn


def _found(rays: ControlRays, *, observed: bool = True) -> Contradiction:
    found = contradiction(replace(rays, observed=observed))
    assert found is not None
    return found


def test_good_positions_and_control_say_nothing_whatever_the_rotation() -> None:
    for seed in range(5):
        assert contradiction(_rays(seed=seed)) is None


def test_positions_of_a_flight_plan_say_nothing() -> None:
    assert contradiction(replace(_rays(error_m=50.0), observed=False)) is None


@pytest.mark.parametrize(
    ("change", "of", "text"),
    [
        (lambda xyz: xyz[:, [1, 0, 2]], "control", "control with X and Y exchanged"),
        (lambda xyz: xyz / [1, 1, 0.3048], "control", "control with heights taken as feet"),
        (lambda xyz: xyz * [1, 1, 1000], "control", "control with heights divided by 1000"),
        (lambda xyz: xyz * [1, 1, 0.3048], "control", "metres that were divided by 0.3048"),
        (lambda xyz: xyz / 0.3048, "control", "control taken as feet"),
        (lambda xyz: xyz / 1000, "control", "control times 1000"),
        (lambda xyz: xyz * 1000, "control", "control divided by 1000"),
        (lambda xyz: xyz * 100, "control", "control divided by 100,"),
    ],
)
def test_a_cause_in_the_control_is_named_and_certain(change, of: str, text: str) -> None:
    rays = _rays()
    rays = replace(rays, position_m=rays.position_m - [5000, 9000, 0], control_m=rays.control_m - [5000, 9000, 0])
    found = _found(replace(rays, control_m=change(rays.control_m)))
    assert found.of == of
    assert text in found.text
    assert found.certain
    assert len(found.images) == 6


def test_depths_for_heights_are_named() -> None:
    rays = _rays()
    found = _found(replace(rays, control_m=rays.control_m * [1, 1, -1]))
    assert "sign of the heights" in found.text
    assert found.certain


@pytest.mark.parametrize("factor", [4.0, 0.2, 400.0])
def test_another_principal_distance_is_told_with_its_value(factor: float) -> None:
    rays = _rays()
    found = _found(replace(rays, c_mm=rays.c_mm * factor))
    assert found.of == "camera"
    assert f"a principal distance of 100 instead of {C_MM * factor:.4g} mm" in found.text
    assert found.certain


@pytest.mark.parametrize(("sigma", "level"), [(0.0, "error"), (float("inf"), "warning")])
def test_a_principal_distance_that_is_free_may_begin_far_off(tmp_path: Path, sigma: float, level: str) -> None:
    small = flown(relief_m=150.0, noise=0.0)
    small.control = dict.fromkeys(small.xyz_m, "XYZ")
    small.camera = {"principal_distance": 0.6 * C_MM, "sigmas": {"principal_distance": sigma}}
    block = read_block(small.write(tmp_path / "block"))
    (seen,) = angles_that_differ(block, photo_mm(block), np.ones(len(block.image_points), dtype=bool))
    assert seen.level == level
    assert "a principal distance of 100" in seen.sentence


def test_a_height_or_a_principal_distance_that_fit_alike_are_both_told_in_one_sentence() -> None:
    rays = _rays()
    found = _found(replace(rays, c_mm=rays.c_mm * 1.1))
    assert "higher, or with a principal distance of 100 instead of 110 mm, by " in found.text


def test_a_principal_point_from_the_corner_is_named() -> None:
    rays = _rays()
    corner = np.full_like(rays.xy_mm, 115.0)
    found = _found(replace(rays, xy_mm=rays.xy_mm - corner, principal_point_mm=corner))
    assert "principal point in the middle" in found.text


@pytest.mark.parametrize("lift", [65.0, -70.0])
def test_another_surface_of_heights_is_a_warning_with_its_value(lift: float) -> None:
    rays = _rays()
    found = _found(replace(rays, position_m=rays.position_m + np.array([0, 0, lift])))
    assert found.of == "position"
    assert f"positions {abs(lift):.3g} m {'lower' if lift > 0 else 'higher'}" in found.text
    assert not found.certain


def test_control_of_another_project_is_an_error_without_a_cause() -> None:
    rays = _rays()
    found = _found(replace(rays, control_m=rays.control_m + np.array([3100.0, 1250.0, 40.0])))
    assert "do not belong together" in found.text
    assert found.certain
    plan = replace(rays, control_m=rays.control_m + np.array([3100.0, 1250.0, 40.0]))
    assert not _found(plan, observed=False).certain


def test_a_single_image_of_another_camera_is_named() -> None:
    rays = _rays()
    found = _found(replace(rays, c_mm=np.where(rays.image == 2, 125.0, rays.c_mm)))
    assert found.images.tolist() == [2]
    assert not found.certain


@pytest.mark.parametrize("factor", [0.8, 1.3])
def test_images_of_another_lens_are_told_with_its_principal_distance(factor: float) -> None:
    rays = _rays()
    of_strip = rays.image >= 4
    found = _found(replace(rays, xy_mm=np.where(of_strip[:, None], factor, 1.0) * rays.xy_mm))
    assert f"a principal distance of {C_MM * factor:.4g} instead of {C_MM:.4g} mm" in found.text
    assert found.images.tolist() == [4, 5]
    assert not found.certain
    assert "camera of their own" in found.remedy


def test_two_rays_say_nothing() -> None:
    rays = _rays()
    few = replace(
        rays,
        image=rays.image[:2],
        point=rays.point[:2],
        xy_mm=rays.xy_mm[:2] * 9,
        principal_point_mm=rays.principal_point_mm[:2],
        c_mm=rays.c_mm[:2],
    )
    assert contradiction(few) is None


STRIP = np.array([[100.0 * k, 3.0 * (k % 2), 900.0 + 5.0 * (k % 3)] for k in range(12)])


@pytest.mark.parametrize("ground", [100.0, np.nan])
def test_positions_of_a_flight_are_possible(ground) -> None:
    assert impossible_positions(STRIP, np.array([ground])) == {}


def test_a_height_of_nothing_and_a_place_of_nothing_are_named() -> None:
    xyz = STRIP + np.array([450_000.0, 5_200_000.0, 0.0])
    xyz[3, 2], xyz[7] = 0.0, 0.0
    found = impossible_positions(xyz, np.array([100.0]))
    assert list(found) == [3, 7]
    assert "height of 0 m, that of the others is 905 m" in found[3]
    assert "km from the middle of the others" in found[7]


def test_flights_at_two_heights_and_stations_on_the_ground_are_legal() -> None:
    two = STRIP.copy()
    two[6:, 2] = 500.0
    assert impossible_positions(two, np.array([100.0])) == {}
    assert impossible_positions(STRIP * [1, 1, 0.01], np.array([10.0])) == {}  # around an object, at its height


def test_images_around_an_object_are_legal_however_few_of_them_are_low() -> None:
    """Five at the height of a head, two near the ground, control all over a statue of two metres and a half."""
    angle = np.radians(np.arange(7) * 51.4)
    xyz = np.column_stack([5.0 * np.cos(angle), 5.0 * np.sin(angle), np.where(np.arange(7) < 5, 2.2, 0.4)])
    assert impossible_positions(xyz, np.array([0.05, 0.3, 0.6, 2.4])) == {}
    low = np.array([38.4, 38.7, 35.6, 35.4, 38.6, 38.5, 35.3])  # three of seven below most of the control
    assert impossible_positions(np.column_stack([xyz[:, :2], low]), np.array([35.3, 32.9, 35.0, 35.4])) == {}


@pytest.mark.parametrize(
    ("control", "height"), [((100.0, 110.0, 120.0, 0.0), 0.0), ((100.0, 250.0, 250.0, 400.0), 150.0)]
)
def test_neither_a_low_control_point_nor_relief_hides_a_low_position(control: tuple[float, ...], height: float) -> None:
    xyz = STRIP.copy()
    xyz[3, 2] = height
    assert list(impossible_positions(xyz, np.array(control))) == [3]


def test_one_position_for_all_images_is_no_position() -> None:
    found = impossible_positions(np.tile(STRIP[:1], (5, 1)), np.array([100.0]))
    assert list(found) == [0, 1, 2, 3, 4]
    assert "of all 5 images" in found[0]


def test_one_wrong_point_or_two_exchanged_ones_leave_the_decision_to_the_adjustment() -> None:
    rays = _rays(seed=0)
    moved, exchanged = rays.control_m.copy(), rays.control_m.copy()
    moved[4] += [150.0, 90.0, 0.0]
    exchanged[[4, 5]] = exchanged[[5, 4]]
    found = _found(replace(rays, control_m=exchanged))
    assert found.points == (4, 5)
    assert not found.certain
    alone = contradiction(replace(rays, control_m=moved))
    assert alone is None or (alone.points, alone.certain) == ((4,), False)


def _of(rays: ControlRays, points: tuple[int, ...]) -> ControlRays:
    few = np.isin(rays.point, points)
    columns = {name: getattr(rays, name)[few] for name in ("image", "point", "xy_mm", "principal_point_mm", "c_mm")}
    return replace(rays, **columns)


@pytest.mark.parametrize("points", [(0, 1, 3, 8), (0, 1, 8), (4, 5, 8)])
def test_of_few_control_points_two_exchanged_ones_end_no_run_and_are_named(points: tuple[int, ...]) -> None:
    """Most angles are wrong by more than half, and those of the other points are right, or there are none."""
    rays, exchanged = _of(_rays(), points), _rays().control_m
    two = [points[0], points[-1]]
    exchanged[two] = exchanged[two[::-1]]
    found = _found(replace(rays, control_m=exchanged))
    assert not found.certain
    assert found.points == tuple(two)
    assert "two control points exchanged" in found.text


def test_of_few_control_points_one_far_off_ends_no_run() -> None:
    rays, moved = _of(_rays(), (0, 1, 3, 4)), _rays().control_m
    moved[4] += [900.0, -700.0, 0.0]
    found = _found(replace(rays, control_m=moved))
    assert not found.certain
    assert "one control point may be wrong" in found.text


def test_poor_positions_are_held_against_their_standard_deviations() -> None:
    """60 m at 800 m: an angle is wrong by 8 % for them, and neither lens nor single images are."""
    for seed in range(4):
        rays = _rays(seed=seed, error_m=60.0)
        assert contradiction(rays) is not None
        assert contradiction(replace(rays, sigma_m=np.full(len(rays.position_m), 60.0))) is None
    rays = _rays(error_m=20.0, seed=0)
    exchanged = rays.control_m.copy()
    exchanged[[4, 5]] = exchanged[[5, 4]]
    rays = replace(rays, control_m=exchanged, sigma_m=np.full(len(rays.position_m), 20.0))
    assert _found(rays).points == (4, 5)


@pytest.mark.parametrize(("by", "text"), [(1, "one row earlier"), (-1, "one row later")])
def test_control_that_stands_a_row_off_in_its_table_is_named(tmp_path: Path, by: int, text: str) -> None:
    small = flown(2, 10, points=8)
    often = [p for p in small.xyz_m if sum(q == p for _, q in small.rays) > 2]
    small.control = dict.fromkeys(sorted(often, key=lambda p: small.xyz_m[p][0])[::4], "XYZ")
    folder = small.write(tmp_path / "b")
    table = folder / "ground_points.csv"
    head, *rows = [line.split(",") for line in table.read_text().splitlines()]
    moved = [[row[0], *rows[(k + by) % len(rows)][1:]] for k, row in enumerate(rows)]
    table.write_text("\n".join(",".join(row) for row in [head, *moved]) + "\n")
    with pytest.raises(InputError, match=f"with those of control that stand {text}"):
        block_of_folder(folder)
