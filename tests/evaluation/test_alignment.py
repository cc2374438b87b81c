"""A free datum is fitted to what it is compared with before anything is compared, within what is open of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.artifacts import block as b
from aatri.artifacts.block import Block
from aatri.artifacts.residuals import Residuals
from aatri.artifacts.solution import DatumCarriers, Solution
from aatri.evaluation.accuracy import evaluate
from aatri.geometry.rotations import exp_rotation
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.made_solutions import made_block, made_solution
from tests.stages.chain import run_chain, simulated


def _moved(solution: Solution, turn: list[float], scale: float, shift: list[float]) -> Solution:
    R = exp_rotation(np.array(turn))
    return replace(
        solution,
        points=replace(solution.points, xyz_m=scale * solution.points.xyz_m @ R.T + shift),
        images=replace(
            solution.images,
            position_m=scale * solution.images.position_m @ R.T + shift,
            ground_from_image=R @ solution.images.ground_from_image,
        ),
    )


def _free(block: Block, solution: Solution) -> Solution:
    """Over all points; control and positions took no part."""
    rays = solution.residuals.take(solution.residuals.kind == "image_point")
    carriers = DatumCarriers(kind=np.full(len(block.points), "point"), id=block.points.id)
    return replace(solution, residuals=rays, datum=carriers)


def _umeyama_residuals(x, X):
    """Residuals of the least-squares similarity, by the formulas of Umeyama 1991."""
    dx, dX = x - x.mean(0), X - X.mean(0)
    U, D, Vt = np.linalg.svd(dX.T @ dx / len(x))
    S = np.diag([1, 1, np.sign(np.linalg.det(U) * np.linalg.det(Vt))])
    R = U @ S @ Vt
    c = np.trace(np.diag(D) @ S) / (dx**2).sum() * len(x)
    return c * dx @ R.T - dX


def test_errors_of_a_free_block_are_those_left_by_the_best_similarity() -> None:
    block = made_block()
    noise = np.random.default_rng(3).normal(0, 0.02, (20, 3))
    solution = _free(block, made_solution(block, shift_m=noise))
    assert block.true_points is not None
    expected = _umeyama_residuals(solution.points.xyz_m, block.true_points.xyz_m)
    new = np.ones(20, dtype=bool)
    new[block.ground_points.point[(block.ground_points.role == b.CONTROL).any(axis=1)]] = False
    for found in (solution, _moved(solution, [0.3, -0.2, 1.0], 1.2, [5e5, 4e6, 100.0])):
        figures = evaluate(block, found).metrics()
        assert figures["truth_aligned_components"] == 7
        for k, axis in enumerate("xyz"):
            rmse = float(np.sqrt((expected[new, k] ** 2).mean()))
            assert figures[f"truth_rmse_{axis}_m"] == pytest.approx(rmse, rel=1e-6)
    assert figures["truth_over_theory_x"] == pytest.approx(figures["truth_rmse_x_m"] / figures["theory_rmse_x_m"])


def test_it_is_said_in_the_verdict() -> None:
    block = made_block()
    verdict = evaluate(block, _free(block, made_solution(block))).verdict
    assert "datum free: fitted to them first in 7 of 7 components of a similarity" in verdict


def test_what_observations_determine_stays_and_only_the_rest_is_fitted() -> None:
    """Control in height at three corners: heights stay wrong where they are wrong, plan and scale are fitted."""
    block = made_block()
    xyz = made_solution(block).points.xyz_m
    z = xyz[:, 2]
    solution = made_solution(block)
    solution = _free(block, solution)
    turned = _moved(solution, [0.0, 0.0, 0.7], 1.0, [300.0, -200.0, 0.0])
    rows = block.ground_points.point[(block.ground_points.role == b.CONTROL).any(axis=1)][:3]
    n = len(rows)
    height = Residuals(
        kind=np.full(n, "control"),
        row=np.arange(n),
        image=np.full(n, ""),
        point=block.points.id[rows],
        residual=np.tile([np.nan, np.nan, 0.0], (n, 1)),
        sigma=np.tile([np.nan, np.nan, 0.01], (n, 1)),
        active=np.ones(n, bool),
        unit=np.full(n, "m"),
    )
    turned = replace(turned, residuals=height)
    assert np.linalg.matrix_rank(np.column_stack([xyz[rows][:, :2], np.ones(n)])) == 3
    figures = evaluate(block, turned).metrics()
    assert figures["truth_aligned_components"] == 4
    assert figures["truth_rmse_x_m"] < 1e-6
    assert figures["truth_rmse_z_m"] < 1e-6
    raised = replace(turned, points=replace(turned.points, xyz_m=turned.points.xyz_m + np.array([0.0, 0.0, 0.5])))
    figures = evaluate(block, raised).metrics()
    assert figures["truth_rmse_z_m"] == pytest.approx(0.5, rel=1e-3)
    assert np.ptp(z) > 0


def test_theoretical_standard_deviations_of_another_datum_are_not_compared() -> None:
    block = made_block()
    held = replace(_free(block, made_solution(block)), datum=DatumCarriers(kind=["held"], id=[""]))
    names = evaluate(block, held).metrics()
    assert "truth_rmse_x_m" in names
    assert not [name for name in names if name.startswith(("truth_over", "truth_nees", "check_theory"))]


def test_too_few_check_points_are_no_check_and_no_figure() -> None:
    block = made_block()
    role = block.ground_points.role.copy()
    role[2:] = b.NO_ROLE
    role[:2] = b.CHECK
    block = replace(block, ground_points=replace(block.ground_points, role=role))
    result = evaluate(block, _free(block, made_solution(block)))
    assert result.verdict.startswith("No independent check: the datum is free")
    assert not [n for n, value in result.metrics().items() if n.startswith("check_rmse") and value is not None]


@pytest.mark.slow
def test_a_free_bundle_has_the_errors_that_its_standard_deviations_say() -> None:
    flight = {"strips": 3, "images_per_strip": 6, "cross_strips": 0}
    made = run_chain(simulated(preset="rc30", flight=flight, ties={"new_points": 400}))
    ground, exterior = made.block.ground_points, made.block.exterior
    block = replace(
        made.block,
        ground_points=replace(ground, role=np.zeros_like(ground.role)),
        exterior=exterior.take(np.zeros(len(exterior), dtype=bool)),
    )
    start = _moved(made.strip_block, [0.0, 0.0, 0.01], 1.001, [0.5, -0.3, 0.2])
    found = bundle(block, made.refined, start, options=BundleOptions(datum="free", interior_unknowns=True))
    figures = evaluate(block, found).metrics()
    assert figures["truth_aligned_components"] == 7
    ratios = np.array([figures[f"truth_over_theory_{axis}"] for axis in "xyz"])
    assert np.all((ratios > 0.8) & (ratios < 1.25)), ratios
