"""Control predicted without itself: against adjustments that do not see it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.artifacts.block import CHECK, CONTROL, Block
from aatri.evaluation.accuracy import evaluate
from aatri.evaluation.differences import check_differences, control_differences
from aatri.evaluation.leave_one_out import leave_one_out
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.campaigns.block_changes import digital

PLAIN = BundleOptions(blunders="none", tolerance=1e-7)


def _block() -> Block:
    block = digital(
        5,
        flight={"strips": 2, "images_per_strip": 4},
        known={"full": 5, "plan": 2, "height": 2, "check_full": 0, "check_plan": 0, "check_height": 0},
    )
    g = block.ground_points
    skew = np.array([[1.0, 0.5, 0.0], [0.5, 1.0, -0.3], [0.0, -0.3, 1.0]]) * 0.02**2  # a full covariance
    return replace(block, ground_points=replace(g, covariance_m2=np.tile(skew, (len(g), 1, 1))))


@pytest.mark.slow
def test_it_is_what_an_adjustment_without_the_point_predicts() -> None:
    block = _block()
    points = calibrated(block)
    solution = bundle(block, points, options=PLAIN)
    found = leave_one_out(block, solution, control_differences(block, solution)).differences
    g = block.ground_points
    rows = np.flatnonzero((g.role == CONTROL).any(axis=1))
    assert found.point.tolist() == g.point[rows].tolist()
    worst = 0.0
    for k, row in enumerate(rows.tolist()):
        role = g.role.copy()
        role[row] = np.where(role[row] == CONTROL, CHECK, role[row])
        without = replace(block, ground_points=replace(g, role=role))
        check = check_differences(without, bundle(without, points, options=PLAIN))
        assert check.point.tolist() == [int(g.point[row])]
        np.testing.assert_array_equal(np.isfinite(found.difference_m[k]), np.isfinite(check.difference_m[0]))
        some = np.isfinite(check.difference_m[0])
        sigma = check.sigma_m[0, some]
        worst = max(worst, float((np.abs(found.difference_m[k] - check.difference_m[0])[some] / sigma).max()))
        np.testing.assert_allclose(found.sigma_m[k, some], sigma, rtol=0.01)
    assert worst < 0.01  # of a standard deviation: what is not linear
    print("largest disagreement, sigma:", worst)  # noqa: T201


def test_figures_and_verdict_have_it_and_a_point_that_nothing_controls_is_counted() -> None:
    block = _block()
    g = block.ground_points
    role = np.where((g.role == CONTROL).any(axis=1)[:, None], 0, g.role)
    full = np.flatnonzero((g.role == CONTROL).all(axis=1))
    role[full[:2]] = CONTROL
    role[full[2], 2] = CONTROL  # seven coordinates for seven parameters: no redundancy anywhere
    least = replace(block, ground_points=replace(g, role=role.astype(g.role.dtype)))
    solution = bundle(least, calibrated(least), options=PLAIN)
    result = evaluate(least, solution)
    assert "left_out_points" not in result.metrics()
    result = evaluate(block, bundle(block, calibrated(block), options=PLAIN))
    figures = result.metrics()
    assert figures["left_out_points"] == 9
    assert figures["left_out_rmse_x_m"] > figures["control_rmse_x_m"]
    for axis, n in (("x", 7), ("y", 7), ("z", 7)):  # five full, two in plan, two in height
        assert 1.0 < figures[f"left_out_independent_{axis}"] <= n
        low, high = figures[f"left_out_theory_ratio_{axis}_low"], figures[f"left_out_theory_ratio_{axis}_high"]
        assert low < 1.0 < high
    assert "Control predicted without itself: X " in result.verdict
    mine = result.differences.kind == "left_out"
    d, s = result.differences.difference_m[mine], result.differences.sigma_m[mine]
    known = np.isfinite(d)
    assert figures["left_out_rmse_z_m"] == pytest.approx(np.sqrt((d[known[:, 2], 2] ** 2).mean()))
    assert np.abs(d[known] / s[known]).max() < 4.5
