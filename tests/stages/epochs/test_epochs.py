"""Two simulated epochs compared: moved points, surveys and cameras, with one thing wrong in each."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.adapters.cameras.tables import known_distortion
from aatri.artifacts.block import Block, CameraParameters
from aatri.artifacts.solution import Solution
from aatri.errors import InputError
from aatri.evaluation.epochs import EpochPoints, compared
from aatri.formats.results.solution_tables import write_evaluation_tables
from aatri.stages.block.simulate import SimulateOptions, simulate
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.epochs.cameras import cameras
from aatri.stages.epochs.congruence import CongruenceOptions, congruence
from aatri.stages.epochs.surveys import surveys
from aatri.stages.initial_orientation.graph import graph
from aatri.stages.interior_orientation.calibrated import calibrated

CALIBRATED = {"self_calibration": {"set": "brown_conrady", "sigma_um": None}, "point_covariances": ["*"]}


def _epoch(seed: int, moved: int = 0) -> tuple[Block, Solution]:
    options = {
        "preset": "test_field",
        "flight": {"images_per_strip": 8},
        "epoch": {"site": "quarry", "moved": moved, "moved_m": [0.001, 0.005]},
    }
    block = simulate(options=SimulateOptions.model_validate(options), rng=np.random.default_rng(seed))
    image_points = calibrated(block)
    start = graph(block, image_points, rng=np.random.default_rng(0))
    return block, bundle(block, image_points, start, options=BundleOptions.model_validate(CALIBRATED))


@pytest.fixture(scope="module")
def epochs() -> tuple[tuple[Block, Solution], tuple[Block, Solution]]:
    return _epoch(1), _epoch(2, moved=5)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("datum", ["auto", "shift", "similarity"])
def test_all_points_that_have_moved_are_named_and_no_others(epochs, datum) -> None:
    (first, earlier), (second, later) = epochs
    table = congruence(later, earlier, options=CongruenceOptions(datum=datum)).displacements
    true_m = second.true_points.xyz_m - first.true_points.xyz_m
    truly_moved = first.points.id[np.abs(true_m).max(axis=1) > 0]
    assert len(truly_moved) == 5
    assert table.point[table.moved].tolist() == truly_moved.tolist()
    rows = np.flatnonzero(table.moved)
    error = table.displacement_m[rows] - true_m[np.searchsorted(first.points.id, table.point[rows])]
    nees = np.einsum("ni,nij,nj->n", error, np.linalg.inv(table.covariance_m2[rows]), error)
    assert nees.sum() < 37.7  # chi2 of 15 at 0.1 %


@pytest.mark.slow
def test_point_covariances_hold_the_marginal_ones(epochs) -> None:
    (_, solution), _ = epochs
    pairs = solution.point_covariances
    own = pairs.first == pairs.second
    np.testing.assert_allclose(
        pairs.covariance_m2[own], solution.points.covariance_m2[pairs.first[own]], rtol=1e-6, atol=1e-20
    )


def test_a_solution_without_covariances_between_points_is_refused(epochs) -> None:
    (_, earlier), (_, later) = epochs
    with pytest.raises(InputError, match="no covariances between its points"):
        congruence(later, replace(earlier, point_covariances=None))


def test_a_camera_whose_principal_point_has_moved_is_named(epochs) -> None:
    (_, earlier), (_, later) = epochs
    assert not cameras(later, earlier).parameter_changes.moved.any()
    p = later.parameters
    at = (p.name == "x0") & np.isfinite(p.sigma)
    shifted = replace(later, parameters=replace(p, value=p.value + np.where(at, 20 * p.sigma, 0.0)))
    changes = cameras(shifted, earlier).parameter_changes
    assert changes.name[changes.moved].tolist() == ["x0"]


def test_calibrations_that_correct_other_nominal_cameras_are_refused(epochs) -> None:
    (_, earlier), (_, later) = epochs
    sets = later.calibrated_sets
    other = replace(later, calibrated_sets=replace(sets, principal_distance_mm=sets.principal_distance_mm + 0.05))
    with pytest.raises(InputError, match=r"other nominal values than in the earlier calibration: c, x0"):
        cameras(other, earlier)


def test_calibrations_on_top_of_another_known_distortion_are_refused(epochs) -> None:
    """Else the difference of the distortions is taken for a change of k1."""
    (_, earlier), (block, later) = epochs
    assert later.calibrated_sets.distortion.tolist() == ["none"]
    cameras_of = replace(block.cameras, distortion=np.array(["brown"]))
    known = CameraParameters.of(camera=[0], name=["k1"], value=[-1.2e-8], sigma=0.0, free=False)
    distorted = replace(block, cameras=cameras_of, camera_parameters=known)
    assert known_distortion(distorted, 0) == "brown k1=-1.2e-08"
    on_top = replace(later.calibrated_sets, distortion=np.array([known_distortion(distorted, 0)]))
    with pytest.raises(InputError, match=r"another known distortion than .*: brown k1=-1.2e-08, earlier none"):
        cameras(replace(later, calibrated_sets=on_top), earlier)


def test_a_control_point_that_sinks_is_named_by_its_survey(epochs) -> None:
    (first, _), (second, _) = epochs
    assert not surveys(second, first).displacements.moved.any()
    ground = second.ground_points
    xyz_m = ground.xyz_m.copy()
    xyz_m[3, 2] -= 0.05
    sunk = replace(second, ground_points=replace(ground, xyz_m=xyz_m))
    table = surveys(sunk, first).displacements
    assert table.point[table.moved].tolist() == [second.points.id[ground.point[3]]]


def _made_up(seed: int) -> tuple[EpochPoints, EpochPoints, np.random.Generator]:
    rng = np.random.default_rng(seed)
    xyz_m = rng.uniform(-10, 10, (12, 3))
    ids, sigma_m = np.array([f"P{k}" for k in range(12)]), 1e-4
    C = (sigma_m**2 * np.eye(36)).reshape(12, 3, 12, 3)
    noisy = [xyz_m + sigma_m * rng.standard_normal((12, 3)) for _ in range(2)]
    return EpochPoints(ids, noisy[0], C), EpochPoints(ids, noisy[1], C), rng


def test_free_epochs_far_apart_are_laid_on_each_other_by_what_has_not_moved() -> None:
    earlier, later, rng = _made_up(3)
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    R *= np.linalg.det(R)
    moved_m = later.xyz_m.copy()
    moved_m[5] += [0.02, 0.0, -0.01]
    C = np.einsum("ij,njml,kl->nimk", 3 * R, later.covariance_m2, 3 * R)
    turned = EpochPoints(later.id, 3 * moved_m @ R.T + [1000.0, -50.0, 7.0], C)
    result, warnings = compared(earlier, turned, "similarity", level=0.05)
    table = result.displacements
    assert table.point[table.moved].tolist() == ["P5"]
    assert not warnings
    np.testing.assert_allclose(table.displacement_m[table.moved], [[0.02, 0.0, -0.01]], atol=1e-3)
    with pytest.raises(InputError, match="different frames"):
        compared(earlier, turned, "none", level=0.05)


@pytest.mark.parametrize("axis", range(3))
def test_a_frame_shifted_along_one_axis_is_another_frame(axis: int) -> None:
    earlier, later, _ = _made_up(5)
    shifted = EpochPoints(later.id, later.xyz_m + 1000.0 * np.eye(3)[axis], later.covariance_m2)
    with pytest.raises(InputError, match=f"different frames: half of the points differ in {'XYZ'[axis]} by 1000 m"):
        compared(earlier, shifted, "none", level=0.05)


def test_where_all_have_moved_nothing_is_called_congruent_and_one_epoch_given_twice_is_told() -> None:
    earlier, later, _ = _made_up(6)
    shifted = EpochPoints(later.id, later.xyz_m - np.array([0.0, 0.0, 0.5]), later.covariance_m2)
    result, warnings = compared(earlier, shifted, "none", level=0.05)
    assert "12 of 12 points have moved" in result.verdict
    assert "congruent" not in result.verdict
    assert any("more than half of the points have moved" in text for text in warnings)
    for datum in ("none", "similarity"):
        _, warnings = compared(earlier, earlier, datum, level=0.05)
        assert warnings == ("both epochs have the same coordinates: is it one epoch given twice?",)
    assert compared(earlier, later, "none", level=0.05)[1] == ()


def test_exact_points_and_other_ids_are_told() -> None:
    earlier, later, _ = _made_up(4)
    exact = earlier.covariance_m2.copy()
    exact[2, :, 2] = 0.0
    both = [EpochPoints(e.id, e.xyz_m, exact) for e in (earlier, later)]
    _, warnings = compared(*both, "none", level=0.05)
    assert warnings
    assert "P2" in warnings[0]
    with pytest.raises(InputError, match="no point in common"):
        compared(earlier, EpochPoints(np.char.add(later.id, "x"), later.xyz_m, exact), "none", level=0.05)


def test_what_has_moved_is_written_as_tables(epochs, tmp_path: Path) -> None:
    (_, earlier), (_, later) = epochs
    points, parameters = congruence(later, earlier), cameras(later, earlier)
    write_evaluation_tables(points, tmp_path)
    write_evaluation_tables(parameters, tmp_path)
    with (tmp_path / "displacements.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["point"] for row in rows] == points.displacements.point.tolist()
    assert [float(row["displacement_z_m"]) for row in rows] == points.displacements.displacement_m[:, 2].tolist()
    with (tmp_path / "parameter_changes.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["change"]) for row in rows] == parameters.parameter_changes.change.tolist()
