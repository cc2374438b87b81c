"""Error-free simulation with all physical effects on: every stage's output equals the truth."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from tests.stages.chain import Chain, run_chain, simulated

SMALL = {
    "preset": "rc30",
    "flight": {"strips": 3, "images_per_strip": 6, "cross_strips": 1},
    "ties": {"new_points": 300},
    "known": {"full": 12, "check_full": 6},
    "noise": {"factor": 0.0},
}


@pytest.fixture(scope="module")
def tangent() -> Chain:
    return run_chain(simulated(earth="tangent", false_origin_m=(0.0, 0.0), **SMALL))


def _truth(block: Block) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    assert block.true_images is not None
    assert block.true_points is not None
    return block.true_images.position_m, block.true_images.ground_from_image, block.true_points.xyz_m


def test_photo_coordinates_are_those_of_the_collinear_rays(tangent: Chain) -> None:
    X0, R, X = _truth(tangent.block)
    m = tangent.refined.measurements
    u = np.einsum("nji,nj->ni", R[m.image], X[m.point] - X0[m.image])
    expected = -153.84 * u[:, :2] / u[:, 2:]
    np.testing.assert_allclose(m.xy_mm, expected, rtol=0, atol=1e-9)


def test_models_equal_the_truth(tangent: Chain) -> None:
    X0, R, X = _truth(tangent.block)
    o, p = tangent.models.orientations, tangent.models.model_points
    rotation = np.einsum("nji,njk->nik", R[o.left], R[o.right])
    base = np.einsum("nji,nj->ni", R[o.left], X0[o.right] - X0[o.left])
    length = np.linalg.norm(base, axis=1)
    np.testing.assert_allclose(o.left_from_right, rotation, rtol=0, atol=1e-9)
    np.testing.assert_allclose(o.base, base / length[:, None], rtol=0, atol=1e-9)
    left = o.left[p.model]
    model = np.einsum("nji,nj->ni", R[left], X[p.point] - X0[left])
    np.testing.assert_allclose(p.xyz * length[p.model][:, None], model, rtol=0, atol=1e-6)


def test_strips_equal_the_truth(tangent: Chain) -> None:
    X0, R, X = _truth(tangent.block)
    images, points = tangent.strips.strip_images, tangent.strips.strip_points
    for strip in range(len(tangent.strips.strips)):
        mine, its = images.strip == strip, points.strip == strip
        first, second = images.image[mine][:2]
        unit = np.linalg.norm(X0[second] - X0[first])
        positions = (X0[images.image[mine]] - X0[first]) @ R[first]
        np.testing.assert_allclose(images.position[mine] * unit, positions, rtol=0, atol=1e-6)
        expected = (X[points.point[its]] - X0[first]) @ R[first]
        np.testing.assert_allclose(points.xyz[its] * unit, expected, rtol=0, atol=1e-6)
        rotations = np.einsum("ji,njk->nik", R[first], R[images.image[mine]])
        np.testing.assert_allclose(images.strip_from_image[mine], rotations, rtol=0, atol=1e-9)


@pytest.mark.parametrize("stage", ["absolute", "strip_block", "bundle"])
def test_solutions_equal_the_truth(tangent: Chain, stage: str) -> None:
    X0, R, X = _truth(tangent.block)
    solution: Solution = getattr(tangent, stage)
    assert solution.images.oriented.all()
    np.testing.assert_allclose(solution.images.position_m, X0, rtol=0, atol=1e-6)
    np.testing.assert_allclose(solution.images.ground_from_image, R, rtol=0, atol=1e-9)
    known = np.isfinite(solution.points.xyz_m).all(axis=1)
    assert known.all()
    np.testing.assert_allclose(solution.points.xyz_m, X, rtol=0, atol=1e-6)


def test_in_a_map_frame_the_image_residuals_stay_below_a_third_of_a_micrometre() -> None:
    chain = run_chain(simulated(earth="map", **SMALL))
    residuals = chain.bundle.residuals
    image = residuals.residual[residuals.kind == "image_point", :2]
    assert np.abs(image).max() < 0.3e-3
    # without the curvature correction they would not: 4.7 um at the corners
    assert np.abs(image).max() > 1e-6
