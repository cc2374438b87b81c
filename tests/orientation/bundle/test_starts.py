"""Starts of the bundle: completed, without shapes, the best of several."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np
import pytest

from aatri.errors import GeometryError
from aatri.geometry.rotations import exp_rotation, rotation_from_angles
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.object_space import object_space_records
from aatri.observations.parameters import ParameterRows
from aatri.observations.poses import POINT, POSE, Poses
from aatri.observations.positions import Positions
from aatri.orientation.bundle import from_afar
from aatri.orientation.bundle.adjusted_terms import adjusted_with_terms
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.complete_start import complete_start
from aatri.orientation.bundle.limits import MOST_FRUITLESS
from aatri.orientation.bundle.result import BundleResult
from aatri.orientation.bundle.space_start import images_turned_over
from tests.campaigns.convergence_basin import disturbed, well_posed, without_positions
from tests.campaigns.kinds import TOGETHER, one_block
from tests.orientation.bundle.made_bundle import made_bundle
from tests.orientation.bundle.parts import Parts, adjust_bundle, adjust_bundle_from_afar

# What a bundle's start lacks: images resected on known points, all that can be at once.

C_MM = 150.0


def test_images_and_points_without_start_follow_from_those_that_have_one() -> None:
    rng = np.random.default_rng(1)
    n_images, n_points = 7, 40
    X0 = np.column_stack([200.0 * np.arange(n_images), rng.normal(0, 5, n_images), np.full(n_images, 1000.0)])
    R = rotation_from_angles(rng.normal(0, 0.05, (n_images, 3)))
    xyz = rng.uniform([-100, -500, -80], [1400, 500, 80], (n_points, 3))
    image, point = (a.ravel().astype(np.int32) for a in np.indices((n_images, n_points)))
    u = np.einsum("nji,nj->ni", R[image], xyz[point] - X0[image])
    xy = -C_MM * u[:, :2] / u[:, 2:]
    active = np.ones(len(xy), dtype=bool)
    active[(image == 6) & (point >= 3)] = False  # three points make no start
    wrong = np.flatnonzero((image == 4) & (point == 5))
    xy[wrong] += 90.0
    active[wrong] = False
    order = rng.permutation(len(xy))
    rays = ImagePointRows(image, point, xy, np.full(xy.shape, 0.01), np.full(len(xy), C_MM), np.zeros(xy.shape), active)
    start_X0, start_R, start_xyz = X0.copy(), R.copy(), np.full_like(xyz, np.nan)
    start_X0[2:], start_R[4:] = np.nan, np.nan
    poses, found = complete_start(rays.take(order), Poses(start_X0, start_R), start_xyz)
    np.testing.assert_allclose(found, xyz, atol=1e-6)
    np.testing.assert_allclose(poses.position_m[:6], X0[:6], atol=1e-6)
    np.testing.assert_allclose(poses.ground_from_image[:6], R[:6], atol=1e-9)
    assert np.isnan(poses.position_m[6]).all()


def test_images_that_see_no_known_point_start_where_they_are_offered_if_their_rays_meet() -> None:
    rng = np.random.default_rng(2)
    X0 = np.column_stack([200.0 * np.arange(3), np.zeros(3), np.full(3, 1000.0)])
    R = rotation_from_angles(rng.normal(0, 0.05, (3, 3)))
    xyz = rng.uniform([-200, -300, -80], [600, 300, 80], (12, 3))
    image, point = (a.ravel().astype(np.int32) for a in np.indices((3, 12)))
    u = np.einsum("nji,nj->ni", R[image], xyz[point] - X0[image])
    xy = -C_MM * u[:, :2] / u[:, 2:]
    rays = ImagePointRows(
        image,
        point,
        xy,
        np.full(xy.shape, 0.01),
        np.full(len(xy), C_MM),
        np.zeros(xy.shape),
        np.ones(len(xy), dtype=bool),
    )
    nothing = Poses(np.full((3, 3), np.nan), np.full((3, 3, 3), np.nan))
    offered = Poses(X0 + rng.normal(0, 0.1, (3, 3)), R)
    poses, found = complete_start(rays, nothing, np.full((12, 3), np.nan), offered=offered)
    np.testing.assert_allclose(poses.position_m, X0, atol=0.5)
    np.testing.assert_allclose(found, xyz, atol=3.0)
    turned = R.copy()
    turned[1] = rotation_from_angles(np.array([[0.4, 0.0, 0.0]]))[0] @ R[1]
    poses, _ = complete_start(rays, nothing, np.full((12, 3), np.nan), offered=Poses(X0, turned))
    assert np.isnan(poses.position_m[1]).all() or np.linalg.norm(poses.ground_from_image[1] - R[1]) < 0.01
    np.testing.assert_allclose(poses.position_m[[0, 2]], X0[[0, 2]], atol=0.5)


# A block with a sphere of unknown radius whose images begin 10 m off: the sphere of the start is another one.


@pytest.mark.slow
def test_shapes_are_fitted_anew_where_the_start_of_their_points_is_far_off() -> None:
    found = one_block("relative sphere", 82)
    assert 0.7 < found.squares / found.redundancy < 1.3
    assert found.of_points < 2.0


@pytest.mark.slow
def test_a_cylinder_begins_at_the_axis_that_fits_its_points_and_its_radius() -> None:
    """Another one, through points a few decimetres off, has a minimum of its own."""
    found = one_block(TOGETHER, 3)
    assert 0.9 < found.squares / found.redundancy < 1.1


# Starts from object space: exact conditions, images turned over, and what the direct adjustment cannot do.


@pytest.fixture(scope="module")
def block() -> tuple[Parts, BundleResult, float]:
    given, height_m = well_posed(2)
    return given, adjust_bundle(given, tolerance=1e-6), height_m


def test_the_condition_vanishes_on_the_ray_and_its_jacobians_are_the_derivatives() -> None:
    rng = np.random.default_rng(3)
    n, c, distance = 5, 60.0, 150.0
    rotation = exp_rotation(rng.normal(scale=0.4, size=(n, 3)))
    position, xyz = rng.normal(scale=50.0, size=(n, 3)), rng.normal(scale=50.0, size=(n, 3)) - [0.0, 0.0, 200.0]
    u = np.einsum("nji,nj->ni", rotation, xyz - position)
    xy = -c * u[:, :2] / u[:, 2:]
    rows = np.arange(n, dtype=np.int32)
    rays = ImagePointRows(rows, rows, xy, np.full((n, 2), 0.005), np.full(n, c), np.zeros((n, 2)), np.ones(n, bool))
    on_ray = object_space_records(rays, distance, 1.0)
    state = {POSE: Poses(position, rotation), POINT: xyz}
    np.testing.assert_allclose(on_ray.residuals(state), 0.0, atol=1e-12)
    off = object_space_records(replace(rays, xy_mm=xy + 3.0), distance, 10.0)
    assert off.whitener[0, 0] == pytest.approx(1 / 0.05)
    v, (by_pose, by_point) = off.evaluate(state, rows)
    step = 1e-4
    for k in range(3):
        d = np.zeros(3)
        d[k] = step
        for J, there, back in (
            (by_pose[:, :, k], (position + d, rotation, xyz), (position - d, rotation, xyz)),
            (
                by_pose[:, :, 3 + k],
                (position, exp_rotation(np.tile(d, (n, 1))) @ rotation, xyz),
                (position, exp_rotation(np.tile(-d, (n, 1))) @ rotation, xyz),
            ),
            (by_point[:, :, k], (position, rotation, xyz + d), (position, rotation, xyz - d)),
        ):
            a, b = (off.evaluate({POSE: Poses(p, r), POINT: x}, rows)[0] for p, r, x in (there, back))
            np.testing.assert_allclose((a - b) / (2 * step), J, rtol=1e-6, atol=1e-6 * np.abs(v).max())


@pytest.mark.slow
@pytest.mark.parametrize(("angle_deg", "share"), [(30.0, 0.3), (0.0, 0.5), (45.0, 0.3), (60.0, 0.5)])
def test_starts_far_off_end_where_the_truth_does(
    block: tuple[Parts, BundleResult, float], angle_deg: float, share: float
) -> None:
    given, reference, height_m = block
    start = disturbed(given, np.random.default_rng(11), angle_deg, share * height_m)
    found = adjust_bundle_from_afar(start, covariances=False, max_iterations=100, tolerance=1e-5)
    sigma = np.sqrt(np.einsum("nii->ni", reference.point_covariance_m2))
    assert np.nanmax(np.abs(found.xyz_m - reference.xyz_m) / np.where(sigma > 0, sigma, 1e-6)) < 1e-4


def test_a_good_start_is_adjusted_once_and_gives_the_same_bits(
    block: tuple[Parts, BundleResult, float],
) -> None:
    given, _, height_m = block
    start = disturbed(given, np.random.default_rng(1), 1.0, 0.01 * height_m)
    direct, afar = adjust_bundle(start), adjust_bundle_from_afar(start)
    np.testing.assert_array_equal(direct.xyz_m, afar.xyz_m)
    assert len(direct.adjusted.history) == len(afar.adjusted.history)


def test_an_image_turned_over_is_found_and_is_no_result(block: tuple[Parts, BundleResult, float]) -> None:
    """Without observed positions an image mirrored on flat ground fits as well, with all its points behind it."""
    given, _, _ = block
    rotation = given.poses.ground_from_image.copy()
    rotation[5] = rotation[5] @ np.diag([1.0, -1.0, -1.0])
    turned = Poses(given.poses.position_m, rotation)
    over = images_turned_over(given.rays, turned, given.xyz_m)
    assert np.flatnonzero(over).tolist() == [5]


@pytest.mark.slow
def test_a_block_without_datum_is_refused_for_that_reason(block: tuple[Parts, BundleResult, float]) -> None:
    given = without_positions(block[0])
    c, none = given.control, np.zeros(0, dtype=np.int64)
    nothing = replace(
        c,
        row=c.row[none],
        point=c.point[none],
        xyz_m=c.xyz_m[none],
        covariance_m2=c.covariance_m2[none],
        observed=c.observed[none],
        exact=c.exact[none],
    )
    with pytest.raises(GeometryError, match="leave 7 unknown"):
        adjust_bundle_from_afar(replace(given, control=nothing), covariances=False)


def test_a_block_that_its_positions_hardly_level_turns_at_few_steps() -> None:
    """Turned by 40 degrees, heights to 300 m: along the tangents of the turn it does not converge in 60 steps."""
    parts = made_bundle(4)
    rng = np.random.default_rng(4)
    images = np.arange(6, dtype=np.int32)
    observed_m = parts.poses.position_m + rng.normal(0, 1.0, (6, 3))
    sigma_m = np.array([3.0, 3.0, 300.0])
    positions = Positions(images, images, observed_m, np.tile(np.diag(sigma_m**2), (6, 1, 1)), np.zeros((6, 3)))
    R, middle = exp_rotation(np.radians([40.0, 20.0, 12.0])), parts.poses.position_m.mean(axis=0)
    poses = Poses((parts.poses.position_m - middle) @ R.T + middle, R @ parts.poses.ground_from_image)
    turned = replace(parts, poses=poses, xyz_m=(parts.xyz_m - middle) @ R.T + middle, positions=positions)
    result = adjust_bundle(turned)
    assert len(result.adjusted.history) <= 12


def test_a_ray_metres_off_its_point_does_not_take_the_column_of_a_parameter() -> None:
    """A point of another number near the horizon of an image: the film ends where 6 degrees more end."""
    made = made_bundle(start_error=0.0)
    rays, xyz = made.rays, made.xyz_m.copy()
    spoilt = int(np.flatnonzero(rays.image == 2)[0])
    x, y, z = made.poses.position_m[2]
    far = np.vstack([xyz, [x + 60_000.0, y, z - 1_200.0]])
    point = rays.point.copy()
    point[spoilt] = len(xyz)

    def seventh_power(xy_mm: np.ndarray) -> np.ndarray:
        return ((xy_mm / 115.0) ** 7)[:, :, None]

    lens = ParameterRows(
        "additional", np.array(["k1"]), ("k",), *(np.full((1, 1), v) for v in (0.0, True, 0.0)), np.ones((1, 1, 1)),
        np.zeros((1, 1), bool), np.zeros(len(rays.point), np.int32), seventh_power(rays.xy_mm), terms=seventh_power,
    )  # fmt: skip
    block = replace(
        made, rays=replace(rays, point=point), xyz_m=far, point_ids=[*made.point_ids, "far"], parameters=(lens,)
    ).together()
    formed: list[BundleInput] = []

    def adjust(block: BundleInput) -> BundleResult:
        formed.append(block)
        return cast(BundleResult, None)

    adjusted_with_terms(block, adjust, adjust)
    assert len(formed) == 1, "the start fits"
    basis = formed[0].parameters[0].basis
    assert basis is not None
    assert np.abs(basis).max() <= ((115.0 + 0.1 * 150.0) / 115.0) ** 7
    others = np.arange(len(rays.point)) != spoilt
    np.testing.assert_allclose(basis[others], seventh_power(rays.xy_mm)[others], rtol=0, atol=7 * 5 * 0.01 / 115.0)


def test_other_starts_are_tried_no_more_where_they_better_nothing(
    block: tuple[Parts, BundleResult, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A search adjusts a block that does not fit many times: each time four starts led to the same."""
    inputs, tried = block[0].together(), list[BundleResult]()

    def fruitless(_: BundleInput, best: BundleResult, *rest: object, **options: object) -> BundleResult:
        tried.append(best)
        return best

    monkeypatch.setattr(from_afar, "_trusted", lambda *_: False)
    monkeypatch.setattr(from_afar, "_best_restart", fruitless)
    restarts = from_afar.Restarts()
    for _ in range(4):
        from_afar.adjust_bundle_from_afar(inputs, restarts=restarts)
    assert len(tried) == MOST_FRUITLESS
    from_afar.adjust_bundle_from_afar(inputs)  # of another block nothing is known
    assert len(tried) == MOST_FRUITLESS + 1
