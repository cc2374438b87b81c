"""The stage relative_orientation/dependent."""

from __future__ import annotations

import dataclasses
from dataclasses import replace

import numpy as np
import pytest

from aatri.errors import ArtifactError, ConvergenceError
from aatri.stages.interior_orientation.affine import affine
from aatri.stages.relative_orientation.dependent import ClassicalOptions, dependent
from tests.stages.chain import simulated
from tests.stages.made_strips import made_strips


class Log:
    """Keeps what a stage says."""

    def __init__(self) -> None:
        self.logs, self.warnings = [], []

    def log(self, message: str) -> None:
        self.logs.append(message)

    def warn(self, message: str) -> None:
        self.warnings.append(message)

    def progress(self, done, total, what="") -> None:
        pass


def test_error_free_strips_flown_to_and_fro_give_the_true_models() -> None:
    made = made_strips(4, 2)
    models = dependent(made.block, made.image_points)
    o, p = models.orientations, models.model_points
    assert o.id.tolist() == ["1-00-1-01", "1-01-1-02", "1-02-1-03", "2-00-2-01", "2-01-2-02", "2-02-2-03"]
    for k, (i, j) in enumerate(zip(o.left, o.right)):
        base = made.R[i].T @ (made.X0[j] - made.X0[i])
        length = np.linalg.norm(base)
        np.testing.assert_allclose(o.left_from_right[k], made.R[i].T @ made.R[j], atol=1e-12)
        np.testing.assert_allclose(o.base[k], base / length, atol=1e-12)
        rows = p.model == k
        expected = (made.ground[p.point[rows]] - made.X0[i]) @ made.R[i] / length
        np.testing.assert_allclose(p.xyz[rows], expected, atol=1e-11)
    assert p.active.all()
    assert len(models.unformed) == len(models.suspects) == 0


def test_order_follows_sequence_and_not_the_ids() -> None:
    made = made_strips(4, sequence=[30.0, 20.0, 10.0, 0.0])
    models = dependent(made.block, made.image_points)
    assert models.orientations.left.tolist() == [3, 2, 1]
    assert models.orientations.right.tolist() == [2, 1, 0]


def test_a_wrong_sequence_is_reported() -> None:
    log = Log()
    made = made_strips(5, sequence=[0.0, 3.0, 2.0, 1.0, 4.0])
    dependent(made.block, made.image_points, context=log)
    assert any("1-00 shares more points with 1-01" in warning for warning in log.warnings)
    log = Log()
    made = made_strips(5)
    dependent(made.block, made.image_points, context=log)
    assert [text for text in log.warnings if "sigma0" not in text] == []  # without errors sigma0 is 0


def test_sigma0_of_all_models_is_told_and_beyond_the_limit_there_is_no_result():
    flight = {"strips": 1, "images_per_strip": 6, "cross_strips": 0}
    block = simulated(preset="rc30", flight=flight, ties={"new_points": 200})
    interior = affine(block)
    log = Log()
    dependent(block, interior, context=log)
    assert [text for text in log.logs if text.startswith("sigma0 of 5 models")]

    def sure(factor):
        m = interior.measurements
        return replace(interior, measurements=replace(m, sigma_mm=m.sigma_mm / factor))

    log = Log()
    dependent(block, sure(3), options=ClassicalOptions(snooping_limit=40.0), context=log)
    assert [text for text in log.warnings if text.startswith("sigma0 of 5 models") and "too small" in text]
    with pytest.raises(ConvergenceError, match=r"sigma0 of 5 models together is .*, beyond max_sigma0 = 20"):
        dependent(block, sure(100), options=ClassicalOptions(snooping_limit=1000.0, max_sigma0=20.0))
    log = Log()
    dependent(block, sure(100), context=log)
    assert [text for text in log.warnings if text.startswith("sigma0 of 5 models") and "too small" in text]


def test_a_gross_error_becomes_a_suspect_that_names_the_right_measurement_and_its_size() -> None:
    made = made_strips(3, noise_mm=0.005)
    common = np.flatnonzero(made.image_points.measurements.image == 1)
    row = int(common[len(common) // 2])
    models = dependent(made.block, made.moved(row, [0.0, 0.2]).image_points)
    own = models.suspects
    assert row in own.row
    k = own.row.tolist().index(row)
    assert own.kind[k] == "image_point"
    assert own.verdict[k] == "rejected"
    assert own.unit[k] == "mm"
    assert abs(abs(own.size[k]) - 0.2) < 4 * own.sigma[k]
    assert own.point[k] == made.block.points.id[made.image_points.measurements.point[row]]
    point = made.image_points.measurements.point[row]
    assert not models.model_points.active[models.model_points.point == point].any()


def test_inactive_images_are_left_out_and_the_neighbours_oriented_to_each_other() -> None:
    made = made_strips(4, active=[True, False, True, True])
    models = dependent(made.block, made.image_points)
    assert models.orientations.id.tolist() == ["1-00-1-02", "1-02-1-03"]


def test_pairs_without_enough_points_are_listed_with_the_reason() -> None:
    made = made_strips(3)
    m = made.image_points.measurements
    keep = (m.image != 2) | (np.arange(len(m)) % 5 == 0)
    log = Log()
    options = ClassicalOptions(min_points=6)
    models = dependent(made.block, made.measured(active=keep).image_points, options=options, context=log)
    assert len(models.orientations) == 1
    assert any("no model 1-01-1-02" in warning for warning in log.warnings)
    assert models.unformed.left.tolist() == [1]
    assert "6 are needed" in models.unformed.reason[0]


def test_two_cameras_in_one_pair_use_each_their_own_principal_distance() -> None:
    made = made_strips(2)
    block = made.block
    cameras = block.cameras.take([0, 0])
    cameras = dataclasses.replace(cameras, id=["a", "b"], principal_distance_mm=[150.0, 100.0])
    images = dataclasses.replace(block.images, camera=[0, 1])
    xy = made.image_points.measurements.xy_mm.copy()
    xy[made.image_points.measurements.image == 1] *= 100.0 / 150.0
    models = dependent(dataclasses.replace(block, cameras=cameras, images=images), made.measured(xy_mm=xy).image_points)
    np.testing.assert_allclose(models.orientations.left_from_right[0], made.R[0].T @ made.R[1], atol=1e-12)


def test_image_points_of_another_block_are_refused() -> None:
    with pytest.raises(ArtifactError, match="another block"):
        dependent(made_strips(3).block, made_strips(4).image_points)


@pytest.mark.slow
def test_the_covariance_is_that_of_repeated_measurement() -> None:
    made = made_strips(2)
    rng = np.random.default_rng(3)
    d, sigma0 = [], []
    for _ in range(150):
        noisy = made.moved(slice(None), rng.normal(0, 0.005, made.image_points.measurements.xy_mm.shape))
        o = dependent(made.block, noisy.image_points, options=ClassicalOptions(snooping_limit=9)).orientations
        d.append(_vee(o.left_from_right[0] @ (made.R[0].T @ made.R[1]).T))
        sigma0.append(o.sigma0[0])
    np.testing.assert_allclose(np.std(d, axis=0), np.sqrt(np.diag(o.covariance[0])[:3]), rtol=0.25)
    assert np.mean(np.square(sigma0)) == pytest.approx(1.0, abs=0.12)


def _vee(R):
    return 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
