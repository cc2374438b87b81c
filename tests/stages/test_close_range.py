"""Close-range blocks: inner constraints, a bar, camera parameters; sigmas and correlations against dense matrices."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from aatri.artifacts.block import Block, Geodetic
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.dense_bundle import Dense, blocks, brown_residual, by_complex_step, correlations, inner_constraints
from tests.stages.close_range_blocks import TEN, field_block, measured, with_bar, with_open_camera
from tests.stages.film_blocks import Told


def _adjusted(block: Block, points: ImagePoints) -> Solution:
    # no step is left that would move the place of the linearisation by more than rounding
    return bundle(
        block,
        points,
        options=BundleOptions(datum="free", tolerance=1e-8, max_iterations=60, blunders={"method": "none"}),
    )


def _dense(block: Block, points: ImagePoints, solution: Solution) -> np.ndarray:
    """Q of poses, points and the ten parameters of the camera, at the adjusted values."""
    m, images, ground = points.measurements, solution.images, solution.points
    n, k = len(images), len(ground)
    p = solution.parameters
    value = {str(name): v for name, v in zip(p.name, p.value)}
    nominal = {f"principal_point.{axis}": x for axis, x in zip("xy", block.cameras.principal_point_mm[0])}
    camera = np.array([value[name] - nominal.get(name, 0.0) for name in TEN])
    xy = m.xy_mm
    z = np.concatenate(
        [images.position_m[m.image], np.zeros((len(xy), 3)), ground.xyz_m[m.point], np.tile(camera, (len(xy), 1))],
        axis=1,
    )
    R = images.ground_from_image[m.image]
    J = by_complex_step(lambda z: brown_residual(z[:, :9], R, xy, z[:, 9:]), z)
    columns = np.concatenate(
        [
            6 * m.image[:, None] + np.arange(6),
            6 * n + 3 * m.point[:, None] + np.arange(3),
            np.tile(6 * n + 3 * k + np.arange(10), (len(xy), 1)),
        ],
        axis=1,
    )
    dense = Dense.of(6 * n + 3 * k + 10)
    dense.add(J, columns, m.sigma_mm)
    ends = np.array([int(np.flatnonzero(block.points.id == name)[0]) for name in block.relative_control_members.id])
    away = ground.xyz_m[ends[0]] - ground.xyz_m[ends[1]]
    unit = away / np.linalg.norm(away)
    at = 6 * n + np.concatenate([3 * ends[0] + np.arange(3), 3 * ends[1] + np.arange(3)])
    dense.add(np.concatenate([unit, -unit])[None, None], at[None], block.relative_control.sigma[:, None])
    return dense.covariance(inner_constraints(len(dense.N), 6 * n, ground.xyz_m))


def _same(found: np.ndarray, expected: np.ndarray) -> None:
    """Sigmas to 1e-8 of themselves, correlations to 1e-8."""
    for mine, theirs in zip(found, expected, strict=True):
        np.testing.assert_allclose(np.sqrt(np.diag(mine)), np.sqrt(np.diag(theirs)), rtol=1e-8)
        np.testing.assert_allclose(correlations(mine), correlations(theirs), atol=1e-8)


def _camera_covariance(solution: Solution) -> np.ndarray:
    """Covariance of the camera's parameters, as the artifact tells it, in the order of TEN."""
    c, p = solution.parameter_covariances, solution.parameters
    assert c is not None
    row = {int(np.flatnonzero((p.group == "camera") & (p.name == name))[0]): k for k, name in enumerate(TEN)}
    C = np.full((10, 10), np.nan)
    for a, b, value in zip(c.first.tolist(), c.second.tolist(), c.covariance):
        C[row[a], row[b]] = C[row[b], row[a]] = value
    return C


def _held_against_dense(rings: int, per_ring: int, targets: int) -> Solution:
    block = with_bar(with_open_camera(field_block(1, rings, per_ring, targets)))
    points = measured(block)
    solution = _adjusted(block, points)
    n, k = len(solution.images), len(solution.points)
    Q = _dense(block, points, solution)
    _same(solution.images.covariance, blocks(Q, 0, 6, n))
    _same(solution.points.covariance_m2, blocks(Q, 6 * n, 3, k))
    C = _camera_covariance(solution)
    _same(C[None], Q[None, -10:, -10:])
    sigma = dict(zip(solution.parameters.name.tolist(), solution.parameters.sigma))
    np.testing.assert_allclose([sigma[name] for name in TEN], np.sqrt(np.diag(Q)[-10:]), rtol=1e-8)
    return solution


def test_a_small_block_has_the_sigmas_and_correlations_of_a_dense_computation() -> None:
    solution = _held_against_dense(2, 6, 30)
    assert solution.sigma0 == pytest.approx(1.0, abs=4 / np.sqrt(2 * solution.redundancy))


def test_no_correlation_of_a_free_block_is_told_beyond_one() -> None:
    """Cross covariances of one datum over standard deviations of another are none: 2.6 was told of x0 and phi."""
    block = with_bar(with_open_camera(field_block(4, 2, 4, 20)))
    told = Told()
    options = BundleOptions(datum="free", blunders={"method": "none"})
    bundle(block, measured(block), options=options, context=told)
    found = [float(c) for line in told.warnings for c in re.findall(r"correlat\w+(?: by)?:? (-?[\d.]+\d)", line)]
    assert found
    assert max(map(abs, found)) <= 1.0


@pytest.mark.slow
def test_a_block_of_100_images_and_150_targets_has_the_sigmas_and_correlations_of_a_dense_computation() -> None:
    solution = _held_against_dense(4, 25, 150)
    assert len(solution.images) == 100
    assert len(solution.points) == 150
    assert solution.redundancy == solution.observations - (600 + 450 + 10) + 6
    assert solution.sigma0 == pytest.approx(1.0, abs=4 / np.sqrt(2 * solution.redundancy))


def _stretched(block: Block, factor: float) -> Block:
    """Approximate orientations of another scale."""
    return replace(block, exterior=replace(block.exterior, position_m=factor * block.exterior.position_m))


def _distance(start: str, start_kind: str, end: str, end_kind: str, value: float) -> Geodetic:
    one, empty, none = np.ones(1), np.array([""]), np.array([-1], dtype=np.int32)
    return Geodetic(
        type=np.array(["distance"]),
        start=np.array([start]),
        end=np.array([end]),
        via=empty,
        start_kind=np.array([start_kind]),
        end_kind=np.array([end_kind]),
        value=value * one,
        sigma=1e-5 * one,
        set=empty,
        group=empty,
        start_height_m=np.full(1, np.nan),
        end_height_m=np.full(1, np.nan),
        active=np.array([True]),
        reduced=np.array(["no"]),
        file=none,
        line=none,
    )


@pytest.mark.parametrize("ends", [("point", "point"), ("point", "image"), ("image", "image")])
def test_one_distance_of_any_kind_gives_the_size_of_an_object_without_control(ends: tuple[str, str]) -> None:
    """Between points, from a point to a station, between stations; no noise, so that the size is the true one."""
    block = field_block(2, 1, 8, 30, noise=0.0)
    points, images = block.true_points, block.true_images
    assert points is not None
    assert images is not None
    place = {
        "point": [(block.points.id[points.point[k]], points.xyz_m[k]) for k in (0, 20)],
        "image": [(block.images.id[images.image[k]], images.position_m[k]) for k in (0, 5)],
    }
    (a, at), (b, to) = place[ends[0]][0], place[ends[1]][1]
    far = _distance(a, ends[0], b, ends[1], float(np.linalg.norm(to - at)))
    given = _stretched(replace(block, geodetic=far), 1.03)
    solution = _adjusted(given, measured(given))
    xyz = solution.points.xyz_m[points.point]
    found, true = (np.linalg.norm(x[1:] - x[0], axis=1) for x in (xyz, points.xyz_m))
    np.testing.assert_allclose(found, true, rtol=1e-7)
    # without it the size is that of the approximate orientations, and nothing says what it is
    alone = replace(given, geodetic=Geodetic.empty())
    xyz = _adjusted(alone, measured(alone)).points.xyz_m[points.point]
    assert np.linalg.norm(xyz[20] - xyz[0]) / np.linalg.norm(points.xyz_m[20] - points.xyz_m[0]) > 1.01
