"""Calibration over a test field: the parameters of one block in another one, and the image errors they make."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.camera.models.brown import brown_correction
from aatri.errors import InputError, SpecError
from aatri.report.drawing.vectors import error_field_pictures
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.image_refinement.additional_parameters import additional_parameters
from tests.dense_bundle import Rows
from tests.small_blocks import HALF_MM
from tests.stages.bundle_adjustment.test_against_dense_bundle import COLUMNS, both, two_by_four
from tests.stages.chain import Chain, run_chain, simulated
from tests.stages.film_blocks import Told

LENS = {"k1": 5e-9, "k2": -2.2e-13, "b1": 1e-4}
CAMERA = {"distortion": "brown", "brown": LENS, "distortion_known": False}
PROJECT = {"flight": {"strips": 3, "images_per_strip": 6, "cross_strips": 1}, "known": {"full": 12}}
FIELD = {"flight": {"strips": 2, "images_per_strip": 5, "cross_strips": 2}, "known": {"full": 40}}
FILM = BundleOptions(interior_unknowns=True)


def _flown(seed: int, camera: dict[str, object], **options: object) -> Block:
    return simulated(seed, preset="rc30", camera=camera, ties={"new_points": 300}, **options)


def _bundle(chain: Chain, calibration: Solution | None = None, told: Told | None = None, **options: object) -> Solution:
    given = BundleOptions(interior_unknowns=True, **options)  # type: ignore[arg-type]
    return bundle(chain.block, chain.refined, chain.strip_block, calibration, options=given, context=told or Told())


@pytest.fixture(scope="module")
def calibration() -> Solution:
    field = run_chain(_flown(5, CAMERA, **FIELD), FILM)
    return _bundle(field, self_calibration="brown_conrady")


@pytest.fixture(scope="module")
def project() -> Chain:
    return run_chain(_flown(1, CAMERA, **PROJECT), FILM)


@pytest.fixture(scope="module")
def error_free() -> Chain:
    return run_chain(_flown(1, {"distortion": "none"}, **PROJECT), FILM)


def _rmse_m(block: Block, solution: Solution) -> np.ndarray:
    assert block.true_points is not None
    return np.sqrt(np.nanmean((solution.points.xyz_m - block.true_points.xyz_m) ** 2, axis=0))


def test_the_image_errors_are_those_of_the_lens_that_was_put_in(calibration: Solution) -> None:
    """Measured minus ideal is the negative of Brown's correction; a film affinity of the images averages out."""
    fields = calibration.error_fields
    assert fields is not None
    inside = np.linalg.norm(fields.xy_mm, axis=1) < 110.0
    put_in = -1e3 * brown_correction(fields.xy_mm, LENS)
    off = (fields.error_um - put_in)[inside] / fields.sigma_um[inside]
    assert np.abs(put_in[inside]).max() > 10.0
    assert np.abs(off).max() < 4.0
    assert calibration.metrics()["image_error_max_um"] == pytest.approx(
        np.linalg.norm(fields.error_um, axis=1).max(), rel=1e-12
    )


def test_the_report_draws_the_image_errors_and_their_shape(calibration: Solution) -> None:
    assert calibration.error_fields is not None
    errors, shape = (picture.caption for picture in error_field_pictures(calibration.error_fields))
    rms = float(np.sqrt((calibration.error_fields.error_um**2).sum(axis=1).mean()))
    assert f"RMS {rms:.2f} um" in errors
    assert "standard deviation" in errors
    assert "Without shift, scale, rotation and tilt" in shape


def test_the_covariances_hold_the_standard_deviations_of_the_parameters(calibration: Solution) -> None:
    c, p = calibration.parameter_covariances, calibration.parameters
    assert c is not None
    own = c.first == c.second
    np.testing.assert_allclose(np.sqrt(c.covariance[own]), p.sigma[c.first[own]], rtol=1e-12)
    assert (p.group[c.first] == "additional").all()
    assert len(c) == 10 * 11 // 2


@pytest.mark.slow
def test_parameters_of_a_test_field_bring_back_the_accuracy(
    calibration: Solution, project: Chain, error_free: Chain
) -> None:
    reference = _rmse_m(error_free.block, error_free.bundle)
    corrected = additional_parameters(project.block, project.refined, calibration)
    assert corrected.corrections.name.tolist()[-1] == "additional parameters"
    fixed = _bundle(replace(project, refined=corrected))
    loss, gain = (_rmse_m(project.block, s) / reference for s in (project.bundle, fixed))
    assert loss.max() > 1.3
    assert gain.max() < 1.15


def test_a_calibration_weights_the_parameters_with_its_covariance(calibration: Solution, project: Chain) -> None:
    told = Told()
    weighted = _bundle(project, calibration, told)
    mine, theirs = (s.parameters.take(s.parameters.group == "additional") for s in (weighted, calibration))
    assert (mine.sigma < theirs.sigma).all()
    assert (np.abs(mine.value - theirs.value) < 4 * np.sqrt(theirs.sigma**2 - mine.sigma**2)).all()
    assert any("difference to the calibration" in line for line in told.lines)


@pytest.mark.slow
def test_a_block_that_adds_next_to_nothing_keeps_the_calibration_and_its_covariances(calibration: Solution) -> None:
    tiny = run_chain(_flown(3, CAMERA, flight={"strips": 2, "images_per_strip": 3}, known={"full": 10}), FILM)
    vague = replace(tiny.refined.measurements, sigma_mm=1e4 * tiny.refined.measurements.sigma_mm)
    chain = replace(tiny, refined=replace(tiny.refined, measurements=vague))
    as_stated = BundleOptions(blunders={"sigmas": "given"})  # type: ignore[arg-type]  # else their residuals say how small
    found = bundle(chain.block, chain.refined, chain.strip_block, calibration, options=as_stated)
    mine = found.parameters.take(found.parameters.group == "additional")
    theirs = calibration.parameters.take(calibration.parameters.group == "additional")
    assert (np.abs(mine.value - theirs.value) < 1e-3 * theirs.sigma).all()
    assert found.parameter_covariances is not None
    assert calibration.parameter_covariances is not None
    pair = calibration.parameter_covariances
    sigma = calibration.parameters.sigma
    change = found.parameter_covariances.covariance - pair.covariance
    assert (np.abs(change) < 1e-3 * sigma[pair.first] * sigma[pair.second]).all()


@pytest.mark.slow
def test_a_camera_that_has_changed_since_its_calibration_is_told(calibration: Solution) -> None:
    other = {**CAMERA, "brown": {"k1": -1e-8, "b1": -1e-4}}
    told = Told()
    _bundle(run_chain(_flown(1, other, **PROJECT), FILM), calibration, told)
    assert any("has the camera changed since" in text for text in told.warnings)


def test_what_does_not_fit_the_block_is_refused(calibration: Solution, project: Chain) -> None:
    with pytest.raises(InputError, match="no additional parameters"):
        _bundle(project, project.bundle)
    with pytest.raises(SpecError, match="self_calibration is ebner12 per camera, the calibration brown_conrady"):
        _bundle(project, calibration, self_calibration="ebner12")
    cameras = project.block.cameras
    longer = replace(cameras, principal_distance_mm=cameras.principal_distance_mm + 0.01)
    with pytest.raises(InputError, match="other nominal values"):
        additional_parameters(replace(project.block, cameras=longer), project.refined, calibration)
    named = replace(cameras, id=np.array(["other"]))
    with pytest.raises(InputError, match="the calibration does not have other"):
        additional_parameters(replace(project.block, cameras=named), project.refined, calibration)
    corrected = additional_parameters(project.block, project.refined, calibration)
    with pytest.raises(SpecError, match="already"):
        additional_parameters(project.block, corrected, calibration)


@pytest.mark.slow
def test_parameters_of_a_test_field_are_observations_with_their_covariance(tmp_path: Path) -> None:
    """Calibrated over a field, weighted in the project (notes 4.7.2, A1108); both in dense matrices."""
    basis, chosen = COLUMNS["ebner12"], {"set": "ebner12", "sigma_um": None, "interior": False}
    field = both(two_by_four(), tmp_path / "field", basis=basis, self_calibration=chosen)
    root = np.linalg.inv(np.linalg.cholesky(field.parameter_covariance))

    def more(block: Block) -> list[Rows]:
        columns = 6 * len(block.images) + 3 * len(block.points) + np.arange(12)[None]
        return [Rows(lambda z: (z - field.parameters) @ root.T, columns, np.ones((1, 12)))]

    project = both(two_by_four(seed=2), tmp_path / "b", basis=basis, more=more, calibration=field.solution)
    np.testing.assert_allclose(project.solution.points.xyz_m, project.xyz_m, rtol=0, atol=1e-9)
    sigma = np.sqrt(np.einsum("nii->ni", project.solution.points.covariance_m2))
    np.testing.assert_allclose(sigma, project.sigma_m, rtol=1e-7)
    free = both(two_by_four(seed=2), tmp_path / "free", basis=basis, self_calibration=chosen)
    assert (project.sigma_m < free.sigma_m + 1e-12).all()
    assert np.median(project.sigma_m / free.sigma_m) < 0.95


def test_image_errors_drawn_are_those_of_the_columns_at_the_scale_printed(tmp_path: Path) -> None:
    """Measured minus ideal is -K p, of covariance K C K'; its shape is what six columns of an orientation leave."""
    basis = COLUMNS["ebner12"]
    chosen = {"set": "ebner12", "sigma_um": None, "interior": False}
    field = both(two_by_four(), tmp_path / "b", basis=basis, self_calibration=chosen)
    fields = field.solution.error_fields
    assert fields is not None
    K = 1e3 * basis(fields.xy_mm)
    error = -K @ field.parameters
    np.testing.assert_allclose(fields.error_um, error, rtol=0, atol=1e-7)
    variance = np.einsum("nij,jk,nik->ni", K, field.parameter_covariance, K)
    np.testing.assert_allclose(fields.sigma_um, np.sqrt(variance), rtol=1e-7)
    (x, y), o = fields.xy_mm.T / HALF_MM, np.zeros(len(fields))
    taken_up = np.stack([[o + 1, o], [o, o + 1], [x, y], [-y, x], [x * x, x * y], [x * y, y * y]])
    A = taken_up.transpose(2, 1, 0).reshape(-1, 6)
    left = error - (A @ np.linalg.lstsq(A, error.ravel(), rcond=None)[0]).reshape(-1, 2)
    np.testing.assert_allclose(fields.shape_um, left, rtol=0, atol=1e-6)
    for picture, vector in zip(error_field_pictures(fields), (error, left)):
        segments = next(marks.xy for marks in picture.marks if marks.shape == "segments")
        assert picture.key is not None
        value, unit = picture.key[1].split()
        printed_mm = float(value) * {"um": 1e-3, "nm": 1e-6, "mm": 1.0}[unit]
        drawn_mm = segments[:, 1] - segments[:, 0]
        np.testing.assert_allclose(drawn_mm / picture.key[0] * printed_mm, 1e-3 * vector, rtol=0, atol=1e-9)
