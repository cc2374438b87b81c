"""Close-range blocks: inner constraints, a bar, camera parameters; sigmas and correlations against dense matrices."""

from __future__ import annotations

import re

import numpy as np
import pytest

from aatri.artifacts.block import Block
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
    camera = np.array([value[name] for name in TEN])
    xy = m.xy_mm
    z = np.concatenate([images.position_m[m.image], np.zeros((len(xy), 3)), ground.xyz_m[m.point],
                        np.tile(camera, (len(xy), 1))], axis=1)  # fmt: skip
    R = images.ground_from_image[m.image]
    J = by_complex_step(lambda z: brown_residual(z[:, :9], R, xy, z[:, 9:]), z)
    columns = np.concatenate([6 * m.image[:, None] + np.arange(6), 6 * n + 3 * m.point[:, None] + np.arange(3),
                              np.tile(6 * n + 3 * k + np.arange(10), (len(xy), 1))], axis=1)  # fmt: skip
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
