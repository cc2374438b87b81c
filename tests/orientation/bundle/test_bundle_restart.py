"""Starts from object space: exact conditions, images turned over, and what the direct adjustment cannot do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.errors import GeometryError
from aatri.geometry.rotations import exp_rotation
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.object_space import object_space_records
from aatri.observations.poses import POINT, POSE, Poses
from aatri.orientation.bundle.result import BundleResult
from aatri.orientation.bundle.space_start import images_turned_over
from tests.campaigns.convergence_basin import disturbed, well_posed, without_positions
from tests.orientation.bundle.parts import Parts, adjust_bundle, adjust_bundle_from_afar


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
