"""The forward model against corrections written on their own."""

import ast
from pathlib import Path

import numpy as np
import pytest

from aatri.errors import InputError
from aatri.geometry.rotations import rotation_from_angles
from aatri.simulation import forward
from aatri.simulation.settings import CameraOptions
from aatri.stages.block.simulate import SimulateOptions, simulate
from tests.simulation import later_corrections as later

BROWN = {"k1": 4e-8, "k2": -2e-12, "k3": 1e-17, "p1": 2e-7, "p2": -1e-7, "b1": 3e-5, "b2": -2e-5}
TABLE = {"distortion": "table", "symmetry_point_mm": (0.02, -0.03)}
FILM = {"principal_point_mm": (0.011, 0.002), "symmetry_point_mm": (0.02, -0.03), "distortion": "brown", "brown": BROWN}


def error_free(seed: int = 3, **options):
    options = {"noise": False, "gnss": {"observed": False}, **options}
    return simulate(options=SimulateOptions(**options), rng=np.random.default_rng(seed))


@pytest.mark.parametrize("earth", ["flat", "tangent"])
@pytest.mark.parametrize("camera", [FILM, {**FILM, **TABLE}, {"principal_point_mm": (0.01, 0.02)}])
def test_the_corrections_in_their_order_give_collinear_coordinates(earth: str, camera) -> None:
    block = error_free(earth=earth, camera=camera, flight={"tilt_sigma_deg": 2.0, "cross_strips": 1})
    xy = later.lens_corrected(later.photo_from_block(block), block)
    heights = later.station_heights(block)[block.image_points.image]
    xy = later.refraction_corrected(xy, 153.84, heights, block.terrain_height_m)
    np.testing.assert_allclose(xy, later.projected(block), rtol=0, atol=1e-10)


def test_the_presets_are_undone_by_the_corrections() -> None:
    for preset, earth in (("rc30", "tangent"), ("uav", "tangent"), ("uav", "flat")):
        block = error_free(preset=preset, earth=earth)
        c = block.cameras.principal_distance_mm[0]
        xy = later.lens_corrected(later.photo_from_block(block), block)
        heights = later.station_heights(block)[block.image_points.image]
        xy = later.refraction_corrected(xy, c, heights, block.terrain_height_m)
        np.testing.assert_allclose(xy, later.projected(block), rtol=0, atol=1e-10)


def test_in_a_map_the_curvature_correction_leaves_what_the_scale_of_heights_makes() -> None:
    # A point at height h is shown d h / R too near to the nadir, which the correction does not know: subtracted here.
    block = error_free(
        earth="map",
        false_origin_m=(446000.0, 4505000.0),
        refraction="none",
        flight={"tilt_sigma_deg": 0.0, "strips": 9, "images_per_strip": 20},
    )
    c, h = 153.84, block.true_points.xyz_m[block.image_points.point, 2]
    above = block.true_images.position_m[block.image_points.image, 2] - h
    xy = later.curvature_corrected(later.photo_from_block(block), c, above)
    model = later.projected(block) * (1 + h / later.EARTH_RADIUS_M)[:, None]
    assert np.abs(later.photo_from_block(block) - model).max() > 0.002  # the effect is there: micrometres
    np.testing.assert_allclose(xy, model, rtol=0, atol=2e-5)


def test_refraction_has_the_size_of_the_table() -> None:
    # docs/formulas.md 2.3: r = 100 mm, c = 152 mm; (H, h) in km -> micrometres
    for H, h, micrometres in ((0.4, 0.02, 0.56), (1, 0, 1.41), (4, 0, 5.71), (9, 0, 11.2)):
        K = forward.refraction_constant_rad(np.array([H]), h)
        displaced = forward.refracted_radially(np.array([[60.0, 80.0]]), K, 152.0)
        assert 1e3 * (np.hypot(*displaced[0]) - 100.0) == pytest.approx(micrometres, abs=0.06)


def test_refraction_and_lens_are_solved_to_the_last_bits() -> None:
    xy = np.random.default_rng(1).uniform(-110, 110, (2000, 2))
    K = np.full(2000, 2e-5)
    displaced = forward.refracted_radially(xy, K, 150.0)
    r = np.hypot(*displaced.T)
    np.testing.assert_allclose(displaced * (1 - K * (1 + (r / 150.0) ** 2))[:, None], xy, rtol=0, atol=1e-13)


def test_bending_in_the_vertical_plane_keeps_the_azimuth_and_equals_the_radial_form_in_a_vertical_image() -> None:
    rng = np.random.default_rng(2)
    d = np.column_stack([rng.uniform(-300, 300, (500, 2)), np.full(500, -385.0)])
    K = np.full(500, 1e-5)
    bent = forward.refracted_in_vertical_plane(d, K)
    np.testing.assert_allclose(d[:, 0] * bent[:, 1], d[:, 1] * bent[:, 0], rtol=0, atol=1e-9)
    radial = forward.refracted_radially(forward.ideal(d, 153.84), K, 153.84)
    np.testing.assert_allclose(forward.ideal(bent, 153.84), radial, rtol=0, atol=1e-12)


def test_in_a_tilted_image_the_two_kinds_of_refraction_differ_by_a_little() -> None:
    radial, physical = (
        error_free(flight={"tilt_sigma_deg": 2.0}, refraction=kind) for kind in ("radial", "vertical_plane")
    )
    difference = np.abs(radial.image_points.xy - physical.image_points.xy).max()
    assert 1e-6 < difference < 1e-4  # 0.6 micrometres of refraction, 2 degrees of tilt


def test_a_camera_frame_vector_is_the_rotated_difference() -> None:
    R = rotation_from_angles([[0.02, -0.01, 1.0]])
    u = np.array([[10.0, -20.0, -300.0]])
    X = np.array([[5.0, 6.0, 400.0]]) + u @ R[0].T
    np.testing.assert_allclose(forward.camera_frame(X, np.array([[5.0, 6.0, 400.0]]), R), u, atol=1e-12)


def test_a_lens_too_strong_is_refused() -> None:
    camera = CameraOptions(distortion="brown", brown={"k1": -1e-3})
    with pytest.raises(InputError, match="distortion"):
        forward.through_lens(np.array([[100.0, 50.0]]), camera)


def test_nothing_of_the_correction_code_is_used() -> None:
    root = Path(__file__).parents[2]
    forbidden = ("aatri.camera", "aatri.observations", "aatri.orientation", "aatri.geometry.collinearity")
    for file in [*sorted((root / "aatri/simulation").glob("*.py")), root / "stages/block/simulate.py"]:
        for node in ast.walk(ast.parse(file.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                names = [f"{node.module}.{a.name}" for a in node.names]
            assert not [n for n in names if n.startswith(forbidden)], file
