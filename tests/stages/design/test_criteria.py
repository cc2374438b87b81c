"""A planned block judged: what is foretold of one more control point is what an adjustment with it gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.artifacts.block import CHECK, CONTROL, Block
from aatri.artifacts.solution import Solution
from aatri.errors import InputError
from aatri.evaluation.layout_figures import CriteriaOptions
from aatri.stages.block.simulate import SimulateOptions, simulate
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.design.criteria import criteria
from aatri.stages.initial_orientation.graph import graph
from aatri.stages.interior_orientation.calibrated import calibrated

PLAN = {
    "preset": "uav",
    "flight": {"strips": 2, "images_per_strip": 5},
    "known": {"layout": [], "full": 4, "check_full": 4},
    "ties": {"random_per_image": 60.0},
    "noise": {"factor": 1e-3},
    "gnss": {"observed": False},
}


def _adjusted(block: Block) -> Solution:
    points = calibrated(block)
    start = graph(block, points, rng=np.random.default_rng(0))
    options = BundleOptions.model_validate({"point_covariances": ["*"], "reliability": True, "blunders": "none"})
    return bundle(block, points, start, options=options)


@pytest.fixture(scope="module")
def planned() -> tuple[Block, Solution]:
    block = simulate(options=SimulateOptions.model_validate(PLAN), rng=np.random.default_rng(1))
    return block, _adjusted(block)


def test_the_gain_of_a_control_point_is_that_of_the_block_adjusted_with_it(planned) -> None:
    block, solution = planned
    sigma_m = (1.0, 1.0, 1.0)
    result = criteria(block, solution, options=CriteriaOptions(sigma_m=sigma_m, control_sigma_m=(0.01, 0.01, 0.015)))
    ground = block.ground_points
    row = int(np.flatnonzero((ground.role == CHECK).all(axis=1))[0])
    role = ground.role.copy()
    role[row] = CONTROL
    covariance = ground.covariance_m2.copy()
    covariance[row] = np.diag([0.01, 0.01, 0.015]) ** 2
    more = _adjusted(replace(block, ground_points=replace(ground, role=role, covariance_m2=covariance)))
    before, after = (float(np.einsum("nii->", s.points.covariance_m2)) for s in (solution, more))
    table = result.layout_points
    (at,) = np.flatnonzero(table.point == block.points.id[ground.point[row]])
    assert table.mean_gain[at] == pytest.approx(1 - after / before, rel=1e-3)


def test_next_control_is_numbered_and_full_control_gains_nothing(planned) -> None:
    block, solution = planned
    result = criteria(block, solution, options=CriteriaOptions(next_points=2))
    table, ground = result.layout_points, block.ground_points
    assert sorted(table.order[table.order > 0].tolist()) == [1, 2]
    first = table.mean_gain[table.order == 1][0]
    assert first == np.nanmax(table.mean_gain)
    control = np.isin(table.point, block.points.id[ground.point[(ground.role == CONTROL).all(axis=1)]])
    assert control.sum() == 4
    assert np.isnan(table.mean_gain[control]).all()
    assert result.metrics()["control_points"] == 4


def test_a_solution_without_covariances_between_points_is_refused(planned) -> None:
    block, solution = planned
    with pytest.raises(InputError, match="no covariances between its points"):
        criteria(block, replace(solution, point_covariances=None))
