"""The stage image_refinement/systematic."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.adapters.refinement.heights import EARTH_RADIUS_M, _level_axes
from aatri.artifacts.block import Block, Exterior
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import ImageOrientations
from aatri.camera.corrections.atmosphere import refraction_constant
from aatri.camera.corrections.vertical_planes import earth_curvature_correction, refraction_correction
from aatri.errors import InputError, SpecError
from aatri.geometry.rotations import rotation_from_angles
from aatri.stages.image_refinement.systematic import SystematicOptions, systematic
from aatri.stages.interior_orientation.affine import affine
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.made_solutions import made_block, made_solution
from tests.stages.chain import simulated
from tests.stages.film_blocks import Told, flown, true_photo_mm

TABLE = {"distortion": "table", "symmetry_point_mm": (0.02, -0.01)}
BROWN = {
    "distortion": "brown",
    "symmetry_point_mm": (0.05, 0.03),
    "brown": {"k1": 5e-9, "p1": 1e-7, "b1": 1e-5, "b2": 2e-5},
}


@pytest.fixture(scope="module")
def block() -> Block:
    return flown(earth="map")


@pytest.fixture(scope="module")
def points(block: Block) -> ImagePoints:
    return affine(block)


@pytest.mark.parametrize("camera", [{}, TABLE, BROWN])
@pytest.mark.parametrize("earth", ["flat", "tangent"])
def test_the_corrections_invert_the_physics(camera: dict[str, Any], earth: str) -> None:
    # far from the origin Z is the height above sea level, which it is on a flat earth
    lens = {"camera": camera} if camera else {}
    block = flown(earth=earth, false_origin_m=(446e3, 4505e3), **lens)
    found = systematic(block, affine(block))
    assert np.abs(found.measurements.xy_mm - true_photo_mm(block)).max() < 1e-10
    assert found.corrections.name.tolist()[-2:] == ["distortion", "refraction"]
    assert (found.corrections.largest_mm[-2:] > 5e-4).all()


def test_in_a_map_frame_curvature_is_corrected_to_a_fraction_of_a_micrometre(block: Block, points: ImagePoints) -> None:
    # rotations of the near-vertical axes against the tangent frame are part of the truth; tilts up to 2 degrees
    without = systematic(block, points, options=SystematicOptions(earth_curvature=False))
    found = systematic(block, points)
    truth = true_photo_mm(block)
    rms = [np.sqrt(((p.measurements.xy_mm - truth) ** 2).mean()) for p in (without, found)]
    assert rms[1] < 2e-4
    assert rms[0] > 5 * rms[1]
    assert found.corrections.name[-1] == "earth_curvature"


def test_a_correction_is_not_applied_twice(block: Block, points: ImagePoints) -> None:
    once = systematic(block, points)
    with pytest.raises(SpecError, match=r"already applied.*distortion, refraction, earth_curvature"):
        systematic(block, once)
    first = systematic(block, points, options=SystematicOptions(refraction=False, earth_curvature=False))
    second = systematic(block, first, options=SystematicOptions(distortion=False))
    assert np.array_equal(second.measurements.xy_mm, once.measurements.xy_mm)
    assert second.corrections.name.tolist() == once.corrections.name.tolist()


def test_curvature_outside_a_map_frame_is_left_and_told(block: Block, points: ImagePoints) -> None:
    told = Told()
    found = systematic(replace(block, earth_curvature="ignore"), points, context=told)
    assert "earth_curvature" not in found.corrections.name
    assert any("earth curvature is not corrected" in line for line in told.lines)


def test_everything_off_changes_nothing(block: Block, points: ImagePoints) -> None:
    off = SystematicOptions(distortion=False, refraction=False, earth_curvature=False)
    found = systematic(block, points, options=off)
    assert np.array_equal(found.measurements.xy_mm, points.measurements.xy_mm)
    assert found.corrections.name.tolist() == points.corrections.name.tolist()


def test_without_positions_the_flying_height_comes_from_the_photo_scale(block: Block, points: ImagePoints) -> None:
    told = Told()
    blind = replace(block, exterior=Exterior.empty())
    found = systematic(blind, points, context=told)
    wanted = systematic(block, points)
    # heights vary by some metres of 385: less than 3 % of a micrometre
    assert np.abs(found.measurements.xy_mm - wanted.measurements.xy_mm).max() < 2e-4
    assert any("estimated from the scale at control points" in line for line in told.lines)


def test_images_without_a_position_fly_as_high_as_the_others(block: Block, points: ImagePoints) -> None:
    some = replace(block, exterior=block.exterior.take(np.arange(len(block.exterior)) % 4 == 0))
    no_control = replace(some, ground_points=block.ground_points.take(np.zeros(0, int)))
    wanted = systematic(block, points).measurements.xy_mm
    for given in (some, no_control):
        told = Told()
        found = systematic(given, points, context=told)
        assert np.abs(found.measurements.xy_mm - wanted).max() < 2e-4
        assert told.warnings == []
        assert any("flying height of 7 images estimated" in line for line in told.lines)


def test_the_terrain_follows_from_positions_and_parallaxes(block: Block, points: ImagePoints) -> None:
    told = Told()
    alone = replace(block, terrain_height_m=np.nan, ground_points=block.ground_points.take(np.zeros(0, int)))
    found = systematic(alone, points, context=told)
    # 10 % of the flying height would be 10 % of 1.3 um
    assert np.abs(found.measurements.xy_mm - systematic(block, points).measurements.xy_mm).max() < 2e-4
    [line] = [line for line in told.lines if "height of the terrain" in line]
    assert abs(float(line.split(",")[1].split(" m")[0]) - 6.0) < 0.05 * 385


@pytest.mark.parametrize("terrain_m", [6.0, np.nan])
def test_without_any_height_the_corrections_are_left_out_and_their_size_is_told(
    block: Block, points: ImagePoints, terrain_m: float
) -> None:
    told = Told()
    blind = replace(
        block,
        exterior=Exterior.empty(),
        ground_points=block.ground_points.take(np.zeros(0, int)),
        terrain_height_m=terrain_m,
    )
    found = systematic(blind, points, context=told)
    only_lens = systematic(block, points, options=SystematicOptions(refraction=False, earth_curvature=False))
    assert np.array_equal(found.measurements.xy_mm, only_lens.measurements.xy_mm)
    # r = 157 mm in the corner, c = 153.84 mm, H' = 1 km: H' r^3 / (2 R c^2) = 12.8 um, more than the 5 um of a point
    r = float(np.hypot(*only_lens.measurements.xy_mm.T).max())
    size = 1e3 * 1000.0 * r**3 / (2 * 6_371_000.0 * 153.84**2)
    assert any("earth curvature" in text and f"{size:.1f} um for each 1000 m" in text for text in told.warnings)
    assert any("refraction" in line and "um for each 1000 m" in line for line in told.lines)


def test_stations_below_the_terrain_are_named_and_not_corrected(block: Block, points: ImagePoints) -> None:
    told = Told()
    found = systematic(replace(block, terrain_height_m=5000.0), points, context=told)
    assert (found.corrections.largest_mm[-2:] == 0.0).all()
    assert all("not above the terrain (5000.0 m)" in text for text in told.warnings)
    assert len(told.warnings) == 2


def test_curvature_of_tilted_images_is_that_of_their_rays() -> None:
    """Points on a sphere, seen by a tilted camera: the map has them at their distance and height."""
    R_EARTH, H, c = 6_371_000.0, 4000.0, 150.0
    X = np.array([[1500.0, -800.0], [-2500.0, 100.0], [3000.0, 3000.0]])
    turn = rotation_from_angles(np.radians([[20.0, 10.0, 40.0]]), "omega-phi-kappa")[0]

    def seen(depth: Any) -> Any:
        u = np.column_stack([X, -depth]) @ turn
        return -c * u[:, :2] / u[:, 2:]

    curved, flat = seen(H + (X**2).sum(axis=1) / (2 * R_EARTH)), seen(np.full(3, H))
    found = earth_curvature_correction(curved, np.full(3, H), np.full(3, c), np.tile(turn, (3, 1, 1)))
    assert np.abs(flat - curved).max() > 0.01
    assert np.abs(curved + found - flat).max() < 1e-3 * np.abs(flat - curved).max()


@pytest.mark.parametrize("system", ["omega-phi-kappa", "phi-omega-kappa", "roll-pitch-heading"])
def test_tilted_images_are_corrected_by_their_attitudes(block: Block, points: ImagePoints, system: Any) -> None:
    """As a finished orientation would correct them; the others as they are without attitudes."""
    angles = np.zeros((len(block.exterior), 3))
    angles[3] = [np.deg2rad(25.0), np.deg2rad(-10.0), 1.0]
    angles[4] = [np.deg2rad(4.0), 0.0, 1.0]
    oblique = replace(block, rotation=system, exterior=replace(block.exterior, angles_rad=angles))
    options = SystematicOptions(distortion=False)
    found, plain = (systematic(b, points, options=options).measurements.xy_mm for b in (oblique, block))
    tilted = points.measurements.image == block.exterior.image[3]
    assert np.array_equal(found[~tilted], plain[~tilted])
    if system == "roll-pitch-heading":  # north, east, down; x forward, y right, z down: the camera has y to its left
        ned = Rotation.from_euler("ZYX", angles[3, ::-1]).as_matrix()
        level = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]]) @ ned @ np.diag([1.0, -1, -1])
    else:
        level = rotation_from_angles(angles[[3]], system)[0]
    xy, n = points.measurements.xy_mm[tilted], int(tilted.sum())
    K = refraction_constant(block.exterior.position_m[3, 2], block.terrain_height_m)
    turned, c = np.tile(level, (n, 1, 1)), np.full(n, 153.84)
    xy = xy + refraction_correction(xy, np.full(n, K), c, turned)
    above = np.full(n, block.exterior.position_m[3, 2] - block.terrain_height_m)
    xy = xy + earth_curvature_correction(xy, above, c, turned)
    assert np.abs(found[tilted] - xy).max() < 1e-12


def test_rays_too_flat_are_left_and_counted(block: Block, points: ImagePoints) -> None:
    angles = np.zeros((len(block.exterior), 3))
    angles[3] = [np.deg2rad(60.0), 0.0, 0.0]
    told = Told()
    found = systematic(replace(block, exterior=replace(block.exterior, angles_rad=angles)), points, context=told)
    assert np.isfinite(found.measurements.xy_mm).all()
    assert any("flatter than 80 degrees" in line for line in told.lines)


def test_a_distortion_of_more_than_5_percent_is_told_with_both_readings(block: Block, points: ImagePoints) -> None:
    told = Told()
    parameters = block.camera_parameters
    value = np.where(parameters.name == "k1", 3e-6, parameters.value)
    systematic(replace(block, camera_parameters=replace(parameters, value=value)), points, context=told)
    # k1 r^2 = 3e-6 * 2 * 115^2 = 0.079
    assert "7.9 % in the corners" in told.warnings[0]


def test_a_distortion_that_folds_names_its_camera(block: Block, points: ImagePoints) -> None:
    parameters = block.camera_parameters
    value = np.where(parameters.name == "k1", -5e-5, parameters.value)
    folded = replace(block, camera_parameters=replace(parameters, value=value))
    with pytest.raises(InputError, match="folds") as caught:
        systematic(folded, points)
    assert caught.value.where == "camera camera"


def test_oblique_images_are_freed_from_refraction_ray_by_ray() -> None:
    """Rays bent in their vertical planes, by the simulator's own solution, come back to the straight ones."""
    made = {"preset": "oblique", "noise": False, "flight": {"scale_number": 200_000.0}, "ties": {"new_points": 300}}
    bent, straight = (simulated(3, refraction=r, **made) for r in ("vertical_plane", "none"))
    a, b = calibrated(bent), calibrated(straight)
    key = {(int(i), int(p)): k for k, (i, p) in enumerate(zip(b.measurements.image, b.measurements.point))}
    pairs = [(k, key.get((int(i), int(p)))) for k, (i, p) in enumerate(zip(a.measurements.image, a.measurements.point))]
    mine, theirs = np.array([pair for pair in pairs if pair[1] is not None]).T
    true = straight.true_images
    assert true is not None
    n = len(straight.images)
    oriented = ImageOrientations(
        id=straight.images.id,
        oriented=np.ones(n, dtype=bool),
        position_m=true.position_m,
        ground_from_image=true.ground_from_image,
        covariance=np.full((n, 6, 6), np.nan),
        image_points=np.zeros(n, dtype=np.int32),
    )
    poses = replace(made_solution(made_block()), images=oriented)
    options = SystematicOptions(distortion=False, earth_curvature=False)
    corrected = systematic(bent, a, poses, options=options)

    def off_um(points: ImagePoints) -> float:
        return 1e3 * float(np.abs(points.measurements.xy_mm[mine] - b.measurements.xy_mm[theirs]).max())

    assert off_um(a) > 0.3
    assert off_um(corrected) < 0.01 * off_um(a)
    low = replace(poses, images=replace(poses.images, position_m=true.position_m - [0.0, 0.0, 5000.0]))
    told = Told()
    systematic(bent, a, low, options=options, context=told)
    assert any("not above the terrain" in text for text in told.warnings)


def test_level_axes_of_a_place_on_the_sphere_are_east_north_and_up() -> None:
    """Seen from the tangent point, one degree to the east and one to the north: the axes turn by that angle."""
    degree = np.deg2rad(1.0)
    cos, sin = np.cos(degree), np.sin(degree)
    at = EARTH_RADIUS_M * np.array([[0.0, 0.0, 0.0], [sin, 0.0, cos - 1.0], [0.0, sin, cos - 1.0]])
    to_east = [[cos, 0.0, -sin], [0.0, 1.0, 0.0], [sin, 0.0, cos]]
    to_north = [[1.0, 0.0, 0.0], [0.0, cos, -sin], [0.0, sin, cos]]
    np.testing.assert_allclose(_level_axes(at), [np.eye(3), to_east, to_north], rtol=0, atol=1e-12)
