"""The stage image_refinement/systematic."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aatri.artifacts.block import Block, Exterior
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import ImageOrientations
from aatri.errors import GeometryError, InputError, SpecError
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
    assert any("photo scale" in line for line in told.lines)


def test_without_positions_and_control_the_images_are_named(block: Block, points: ImagePoints) -> None:
    blind = replace(block, exterior=Exterior.empty(), ground_points=block.ground_points.take(np.zeros(0, int)))
    with pytest.raises(GeometryError, match="flying height; not known for 10 images") as caught:
        systematic(replace(blind, terrain_height_m=6.0), points)
    assert "exterior.csv" in caught.value.remedy
    with pytest.raises(GeometryError, match="height of the terrain"):
        systematic(replace(blind, terrain_height_m=np.nan), points)


def test_stations_below_the_terrain_are_refused(block: Block, points: ImagePoints) -> None:
    with pytest.raises(GeometryError, match="not above the terrain"):
        systematic(replace(block, terrain_height_m=5000.0), points)


def test_tilted_images_are_refused_by_name(block: Block, points: ImagePoints) -> None:
    angles = np.zeros((len(block.exterior), 3))
    angles[3] = [np.deg2rad(5.2), 0.0, 1.0]
    angles[4] = [np.deg2rad(4.8), 0.0, 1.0]
    oblique = replace(block, exterior=replace(block.exterior, angles_rad=angles))
    with pytest.raises(GeometryError, match="near-vertical") as caught:
        systematic(oblique, points)
    assert caught.value.what.endswith(str(block.images.id[block.exterior.image[3]]))
    off = SystematicOptions(refraction=False, earth_curvature=False)
    assert systematic(oblique, points, options=off).corrections.name[-1] == "distortion"


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
        id=straight.images.id, oriented=np.ones(n, dtype=bool), position_m=true.position_m,
        ground_from_image=true.ground_from_image, covariance=np.full((n, 6, 6), np.nan),
        image_points=np.zeros(n, dtype=np.int32))  # fmt: skip
    poses = replace(made_solution(made_block()), images=oriented)
    options = SystematicOptions(distortion=False, earth_curvature=False)
    corrected = systematic(bent, a, poses, options=options)

    def off_um(points: ImagePoints) -> float:
        return 1e3 * float(np.abs(points.measurements.xy_mm[mine] - b.measurements.xy_mm[theirs]).max())

    assert off_um(a) > 0.3
    assert off_um(corrected) < 0.01 * off_um(a)
    low = replace(poses, images=replace(poses.images, position_m=true.position_m - [0.0, 0.0, 5000.0]))
    with pytest.raises(GeometryError, match="not above the terrain"):
        systematic(bent, a, low, options=options)
