"""Space resection against published examples and error-free data."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from aatri.geometry.rotations import angles_from_rotation, rotation_from_angles
from aatri.orientation.resection.adjustment import ResectedImages, resect_images


@pytest.fixture
def examples(shared_data: Path) -> dict:
    text = (shared_data / "worked_examples" / "resection_intersection.yaml").read_text()
    return {example["id"]: example for example in yaml.safe_load(text)}


def _resect(points: np.ndarray, c: float, start: list[float], kappa: float = 0.0) -> ResectedImages:
    n = len(points)
    return resect_images(
        points[:, :2],
        np.full((n, 2), 0.01),
        np.zeros(n, np.int32),
        np.arange(n, dtype=np.int32),
        np.array([c]),
        points[:, 2:],
        np.array([start]),
        rotation_from_angles([[0.0, 0.0, kappa]]),
    )


def test_the_textbook_example_of_wuhan_university(examples: dict) -> None:
    example = examples["whu_resection_15324"]
    result = _resect(np.array(example["points"]), 153.24, [38500.0, 27900.0, 7500.0])
    answer = example["answer_opk_converged_here"]
    np.testing.assert_allclose(result.position_m[0], answer["X"], atol=1e-6)
    phi_omega_kappa = angles_from_rotation(result.ground_from_image[0], "phi-omega-kappa")
    printed = [example["answer"][f"{name}_rad"] for name in ("phi", "omega", "kappa")]
    np.testing.assert_allclose(phi_omega_kappa, printed, atol=5.1e-6)
    # 4 points, redundancy 2: sigma0 = rms sqrt(8 / 2)
    assert result.rms_mm[0] * 2 == pytest.approx(answer["sigma0_mm"], rel=1e-6)


def test_the_sample_of_dewitt(examples: dict) -> None:
    example = examples["dewitt_resection_152916"]
    result = _resect(np.array(list(example["points"].values())), 152.916, [1000.0, 1000.0, 600.0], kappa=1.8)
    np.testing.assert_allclose(result.position_m[0], example["answer"]["X"], atol=6e-5)
    printed = [example["answer"][f"{name}_deg"] for name in ("omega", "phi", "kappa")]
    np.testing.assert_allclose(np.degrees(angles_from_rotation(result.ground_from_image[0])), printed, atol=6e-5)


def test_the_sample_of_mikhail(examples: dict) -> None:
    example = examples["mikhail_resection_152222"]
    result = _resect(np.array(list(example["points"].values())), 152.222, [914250.0, 575400.0, 800.0], kappa=-1.57)
    np.testing.assert_allclose(result.position_m[0], example["answer"]["X"], atol=1e-5)


def _made(rng: np.random.Generator, n_images: int):
    R = rotation_from_angles(rng.normal(0, 0.05, (n_images, 3)) + np.array([0, 0, 2.0]))
    X0 = rng.normal(0, 50, (n_images, 3)) + np.array([446000.0, 4505000.0, 400.0])
    xyz = rng.uniform(-250, 250, (40, 3)) * [1, 1, 0.1] + [446000.0, 4505000.0, 0.0]
    image = np.repeat(np.arange(n_images), 40).astype(np.int32)
    point = np.tile(np.arange(40), n_images).astype(np.int32)
    u = np.einsum("nji,nj->ni", R[image], xyz[point] - X0[image])
    return R, X0, xyz, image, point, -150.0 * u[:, :2] / u[:, 2:]


def test_error_free_images_return_exactly_and_a_gross_error_hardly_matters() -> None:
    rng = np.random.default_rng(2)
    R, X0, xyz, image, point, xy = _made(rng, 6)
    arguments = (
        np.full(xy.shape, 0.005),
        image,
        point,
        np.full(6, 150.0),
        xyz,
        X0 + 20.0,
        rotation_from_angles(np.tile([0.0, 0.0, 1.9], (6, 1))),
    )
    exact = resect_images(xy, *arguments)
    np.testing.assert_allclose(exact.position_m, X0, atol=1e-7)
    np.testing.assert_allclose(exact.ground_from_image, R, atol=1e-9)
    spoiled = xy.copy()
    spoiled[5] += 3.0
    robust = resect_images(spoiled, *arguments)
    assert robust.resected.all()
    assert np.abs(robust.position_m - X0).max() < 0.05


def test_images_without_enough_points_are_reported_and_not_guessed() -> None:
    rng = np.random.default_rng(3)
    _, X0, xyz, image, point, xy = _made(rng, 2)
    use = (image == 0) | (point < 2)
    start = rotation_from_angles(np.tile([0.0, 0.0, 2.0], (2, 1)))
    result = resect_images(
        xy[use], np.full((use.sum(), 2), 0.005), image[use], point[use], np.full(2, 150.0), xyz, X0 + 5.0, start
    )
    assert result.resected.tolist() == [True, False]
    assert np.isnan(result.covariance[1]).all()
    assert result.points.tolist() == [40, 0]


@pytest.mark.parametrize("below_m", [0.5, 5.0, 40.0])
def test_a_point_that_is_wrong_close_to_the_camera_does_not_move_it(below_m: float) -> None:
    """A bounded weight is not enough: the derivatives grow without bound towards the camera."""
    R, X0, xyz, image, point, xy = _made(np.random.default_rng(4), 1)
    xyz = xyz.copy()
    xyz[7] = X0[0] + [60.0, -20.0, -below_m]
    found = resect_images(xy, np.full(xy.shape, 0.005), image, point, np.full(1, 150.0), xyz, X0 + 2.0, R)
    assert found.resected.all()
    np.testing.assert_allclose(found.position_m, X0, atol=1e-6)
