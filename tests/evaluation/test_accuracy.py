"""Differences and their statistics, and what ratios are to be expected."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from aatri.artifacts import block as b
from aatri.artifacts.residuals import Residuals
from aatri.artifacts.solution import IndependentErrors
from aatri.evaluation.accuracy import evaluate
from aatri.evaluation.statistics import bias, largest, rmse
from aatri.evaluation.verdict import expected_ratios, outside_expected
from aatri.geometry.rotations import exp_rotation
from aatri.stages.accuracy.evaluation import evaluation
from tests.made_solutions import made_block, made_solution

# Accuracy figures against closed forms.


def _figures(block, solution, **options):
    return evaluate(block, solution, **options).metrics()


def test_a_constant_shift_is_rmse_bias_and_largest_at_check_points() -> None:
    block = made_block()
    figures = _figures(block, made_solution(block, shift_m=[0.03, -0.04, 0.12]))
    assert figures["check_points"] == 4
    assert figures["control_points"] == 4
    for axis, shift in zip("xyz", [0.03, -0.04, 0.12]):
        assert figures[f"check_rmse_{axis}_m"] == pytest.approx(abs(shift), rel=1e-9)
        assert figures[f"check_bias_{axis}_m"] == pytest.approx(shift, rel=1e-9)
        assert figures[f"check_max_{axis}_m"] == pytest.approx(abs(shift), rel=1e-9)
        assert figures[f"control_rmse_{axis}_m"] == pytest.approx(abs(shift), rel=1e-9)


def test_truth_is_taken_at_points_without_control_role_and_check_points_are_among_them() -> None:
    block = made_block()
    shift = np.zeros((20, 3))
    shift[:, 0] = np.where(np.arange(20) % 2, 0.02, -0.02)
    figures = _figures(block, made_solution(block, shift_m=shift, sigma_m=0.025))
    assert figures["truth_points"] == 16
    assert figures["truth_rmse_x_m"] == pytest.approx(0.02)
    assert figures["truth_rmse_y_m"] == 0.0
    assert figures["truth_max_x_m"] == pytest.approx(0.02)
    assert figures["theory_rmse_z_m"] == pytest.approx(0.025)
    assert figures["truth_over_theory_x"] == pytest.approx(0.8)
    assert figures["truth_nees"] == pytest.approx(0.8**2 / 3)


def test_a_point_that_is_not_determined_counts_nowhere() -> None:
    block = made_block()
    shift = np.zeros((20, 3))
    shift[4] = np.nan  # p10, a check point
    figures = _figures(block, made_solution(block, shift_m=shift))
    assert figures["check_points"] == 3
    assert figures["truth_points"] == 15
    assert figures["theory_rmse_x_m"] == pytest.approx(0.02)


def test_without_check_points_there_are_no_check_figures_and_the_verdict_says_so() -> None:
    block = made_block(check=False)
    result = evaluate(block, made_solution(block))
    assert result.metrics()["check_points"] == 0
    known = {name for name, value in result.metrics().items() if name.startswith("check_") and value is not None}
    assert known == {"check_points"}
    assert result.metrics()["check_rmse_z_m"] is None  # so that a quality gate finds no value, and not no metric
    assert result.verdict.startswith("No independent check")


def test_without_covariances_there_is_no_theory() -> None:
    block = made_block()
    solution = made_solution(block, sigma_m=np.nan)
    assert not [name for name in _figures(block, solution) if name.startswith("theory_rmse") or "over_theory" in name]


def test_without_truth_theory_is_over_the_determined_new_points() -> None:
    block = made_block(truth=False)
    figures = _figures(block, made_solution(block, sigma_m=0.03))
    assert figures["theory_rmse_y_m"] == pytest.approx(0.03)
    assert not [name for name in figures if name.startswith("truth")]


def test_theory_of_a_network_in_plan_is_of_plan() -> None:
    block = made_block(truth=False)
    solution = made_solution(block, shift_m=[0.0, 0.0, np.nan], sigma_m=0.03)
    covariance = solution.points.covariance_m2 + np.diag([0.0, 0.0, np.nan])
    solution = dataclasses.replace(solution, points=dataclasses.replace(solution.points, covariance_m2=covariance))
    theory = {name: value for name, value in _figures(block, solution).items() if name.startswith("theory")}
    assert theory == {"theory_rmse_x_m": pytest.approx(0.03), "theory_rmse_y_m": pytest.approx(0.03)}


def test_roles_per_coordinate_are_kept_apart() -> None:
    block = made_block()
    role = block.ground_points.role.copy()
    role[0] = [b.CONTROL, b.CONTROL, b.CHECK]
    block = dataclasses.replace(block, ground_points=dataclasses.replace(block.ground_points, role=role))
    shift = np.zeros((20, 3))
    shift[0, 2] = 0.5
    figures = _figures(block, made_solution(block, shift_m=shift))
    assert figures["check_points"] == 5
    assert figures["check_rmse_z_m"] == pytest.approx(0.5 / 5**0.5)
    assert figures["control_rmse_z_m"] == 0.0
    assert figures["truth_points"] == 16  # control in X and Y: not a new point


def test_control_that_nobody_measured_is_no_proof_of_the_fit() -> None:
    block = made_block()
    solution = made_solution(block)
    rays = solution.points.rays.copy()
    rays[0] = 0
    solution = dataclasses.replace(solution, points=dataclasses.replace(solution.points, rays=rays))
    assert _figures(block, solution)["control_points"] == 3


def test_rejected_control_is_counted_apart_and_stays_in_the_table() -> None:
    block = made_block()
    shift = np.zeros((20, 3))
    shift[0] = 5.0  # p00
    solution = made_solution(block, shift_m=shift)
    active = solution.residuals.active & (
        (solution.residuals.point != "p00") | (solution.residuals.kind == "image_point")
    )
    residuals = Residuals(**{**vars(solution.residuals), "active": active})
    result = evaluate(block, dataclasses.replace(solution, residuals=residuals))
    assert result.metrics()["control_rejected_points"] == 1
    assert result.metrics()["control_points"] == 3
    assert result.metrics()["control_rmse_x_m"] == 0.0
    assert "p00" in result.differences.point[result.differences.kind == "control"]
    assert "1 rejected" in result.verdict


def test_check_points_outside_the_control_are_counted_and_summarised_apart() -> None:
    block = made_block()
    xyz = made_solution(block).points.xyz_m
    shift = np.where(xyz[:, :1] == 100.0, 1.0, 0.0) * [0.0, 0.0, 0.1]
    role = np.where(block.ground_points.point[:, None] < 4, b.CHECK, b.CONTROL) * np.ones((1, 3), int)
    # control is now the second column and the far corners; both points of the first column lie outside
    block = dataclasses.replace(block, ground_points=dataclasses.replace(block.ground_points, role=role))
    result = evaluate(block, made_solution(block, shift_m=shift))
    assert result.metrics()["check_outside_points"] == 2
    assert "2 outside the control" in result.verdict


def test_the_chi_square_interval_of_a_check_rmse_is_the_tables() -> None:
    # chi-square 0.975 and 0.025 quantiles for 4 degrees of freedom: 11.143 and 0.4844 (any statistics table)
    block = made_block()
    figures = _figures(block, made_solution(block, shift_m=[0.1, 0.0, 0.0]))
    assert figures["check_rmse_x_low_m"] == pytest.approx(0.1 * (4 / 11.143) ** 0.5, rel=1e-4)
    assert figures["check_rmse_x_high_m"] == pytest.approx(0.1 * (4 / 0.48442) ** 0.5, rel=1e-4)


def test_orientations_are_compared_with_the_truth() -> None:
    block = made_block()
    solution = made_solution(block)
    turn = np.tile([0.0, 3e-5, 4e-5], (len(block.images), 1))
    images = dataclasses.replace(
        solution.images,
        position_m=solution.images.position_m + np.array([0.1, 0.0, -0.2]),
        ground_from_image=exp_rotation(turn),
    )
    figures = _figures(block, dataclasses.replace(solution, images=images))
    assert figures["truth_position_rmse_x_m"] == pytest.approx(0.1)
    assert figures["truth_position_max_m"] == pytest.approx(0.2)
    assert figures["truth_rotation_rmse_rad"] == pytest.approx(5e-5, rel=1e-9)
    assert figures["truth_rotation_max_rad"] == pytest.approx(5e-5, rel=1e-9)
    assert figures["theory_position_rmse_x_m"] == pytest.approx(0.01)
    assert figures["theory_rotation_rmse_rad"] == pytest.approx(3**0.5 * 1e-5)


def test_an_image_that_is_not_oriented_does_not_count() -> None:
    block = made_block()
    solution = made_solution(block)
    oriented = np.ones(len(block.images), bool)
    oriented[0] = False
    gone = np.where(oriented[:, None], solution.images.position_m, np.nan)
    images = dataclasses.replace(
        solution.images,
        oriented=oriented,
        position_m=gone,
        ground_from_image=np.where(oriented[:, None, None], solution.images.ground_from_image, np.nan),
        covariance=np.where(oriented[:, None, None], solution.images.covariance, np.nan),
    )
    assert _figures(block, dataclasses.replace(solution, images=images))["truth_position_max_m"] == 0.0


@pytest.mark.parametrize(("refers_to", "lever"), [(0, 0.0), (1, 0.5)])
def test_observed_positions_are_compared_at_what_they_refer_to(refers_to: int, lever: float) -> None:
    block = made_block()
    n = len(block.images)
    exterior = b.Exterior(
        image=np.arange(n),
        position_m=block.true_images.position_m + np.array([0.0, 0.0, lever]),
        position_covariance_m2=np.tile(np.eye(3) * 0.1**2, (n, 1, 1)),
        angles_rad=np.full((n, 3), np.nan),
        angle_sigma_rad=np.full((n, 3), np.nan),
        position_use=np.ones(n, int),
        angle_use=np.zeros(n, int),
        refers_to=np.full(n, refers_to),
        drift_group=[""] * n,
        file=np.full(n, -1),
        line=np.zeros(n, int),
    )
    cameras = dataclasses.replace(block.cameras, lever_arm_m=[[0.0, 0.0, 0.5]])
    figures = _figures(dataclasses.replace(block, exterior=exterior, cameras=cameras), made_solution(block))
    assert figures["position_rmse_z_m"] == pytest.approx(0.0, abs=1e-12)


def test_exact_control_is_named_in_the_verdict() -> None:
    block = made_block()
    exact = dataclasses.replace(block.ground_points, covariance_m2=np.zeros((len(block.ground_points), 3, 3)))
    result = evaluation(dataclasses.replace(block, ground_points=exact), made_solution(block))
    assert "given as exact" in result.verdict
    assert "fewer than 30" in result.verdict


def test_a_check_point_beyond_every_bound_is_named_with_axis_and_size() -> None:
    block = made_block()
    shift = np.zeros((20, 3))
    shift[4, 2] = 0.9  # p10, a check point
    result = evaluate(block, made_solution(block, shift_m=shift, sigma_m=0.02))
    assert "Check points farther off than standard deviations and sigma0 explain: p10 (900 mm in Z" in result.verdict
    assert "Beyond" not in evaluate(block, made_solution(block, sigma_m=0.02)).verdict


def test_a_large_sigma0_widens_the_bound_of_check_points() -> None:
    block = made_block()
    shift = np.zeros((20, 3))
    shift[4, 2] = 0.9
    solution = dataclasses.replace(made_solution(block, shift_m=shift, sigma_m=0.02), sigma0=20.0, redundancy=100)
    assert "farther off" not in evaluate(block, solution).verdict


def test_check_errors_are_divided_by_what_theory_expects_of_them() -> None:
    block = made_block()
    figures = _figures(block, made_solution(block, shift_m=[0.03, 0.0, 0.06], sigma_m=0.02))
    for axis, shift in (("x", 0.03), ("z", 0.06)):
        wanted = shift / figures[f"check_theory_rmse_{axis}_m"]
        assert figures[f"check_theory_ratio_{axis}"] == pytest.approx(wanted, rel=1e-9)


def test_columns_are_taken_one_by_one_and_nan_takes_no_part() -> None:
    d = np.array([[3.0, np.nan, -1.0], [-4.0, np.nan, 2.0], [np.nan, np.nan, 2.0]])
    np.testing.assert_allclose(rmse(d), [np.sqrt(12.5), np.nan, np.sqrt(3.0)])
    np.testing.assert_allclose(bias(d), [-0.5, np.nan, 1.0])
    np.testing.assert_allclose(largest(d), [4.0, np.nan, 2.0])
    assert largest(np.zeros((0, 2))) == pytest.approx(np.nan, nan_ok=True)


# Limits of empirical over theoretical accuracy by the number of independent errors.


def _evaluated(counts: list[list[float]], sigma_m: float):
    block = made_block()
    independent = IndependentErrors(points=["new", "check"], count=counts)
    shift = np.full((20, 3), 0.02)
    solution = dataclasses.replace(made_solution(block, shift_m=shift, sigma_m=sigma_m), independent_errors=independent)
    return evaluate(block, solution)


def test_limits_are_those_of_chi_square_tables() -> None:
    figures = _evaluated([[10.0, 20.0, np.nan], [4.0, 4.0, 4.0]], 0.02).metrics()
    # chi-square of 10 degrees of freedom: 3.247 and 20.483 at 2.5 and 97.5 %; of 20: 9.591 and 34.170
    assert figures["truth_over_theory_x_low"] == pytest.approx(np.sqrt(3.247 / 10), rel=1e-4)
    assert figures["truth_over_theory_x_high"] == pytest.approx(np.sqrt(20.483 / 10), rel=1e-4)
    assert figures["truth_over_theory_y_high"] == pytest.approx(np.sqrt(34.170 / 20), rel=1e-4)
    assert "truth_over_theory_z_low" not in figures
    assert figures["check_independent_z"] == 4.0


def test_a_ratio_beyond_chance_is_told_and_one_within_is_not() -> None:
    assert "chance gives" not in _evaluated([[10.0] * 3, [4.0] * 3], 0.02).verdict
    verdict = _evaluated([[10.0, 10.0, 3.0], [1.5] * 3], 0.01).verdict  # a ratio of 2
    assert "True errors are 2.00 times their standard deviations in X (chance gives 0.3" in verdict
    assert "2.00 times their standard deviations in Y" in verdict
    assert "standard deviations in Z" not in verdict
    assert "Errors at check points" not in verdict


def test_the_ratio_of_control_left_out_has_its_number_and_limits() -> None:
    independent = IndependentErrors(points=["left_out"], count=[[10.0, 20.0, 3.0]])
    found = expected_ratios({"left_out_theory_ratio_x": 1.1, "left_out_theory_ratio_z": 3.1}, independent, 0.95)
    assert found["left_out_independent_x"] == 10.0
    assert found["left_out_theory_ratio_x_low"] == pytest.approx(np.sqrt(3.247 / 10), rel=1e-4)
    assert "left_out_independent_y" not in found
    ratios = {"left_out_theory_ratio_x": 1.1, "left_out_theory_ratio_z": 3.1}
    (text,) = outside_expected({**found, **ratios}, "left_out")
    assert text.startswith("Errors of control predicted without itself are 3.10 times their standard deviations in Z (")
