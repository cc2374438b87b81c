"""Bundle Adjustment in the Large, problem 49-7776: the optimum that others report, from the start of the file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.reading import read_bal
from tests.stages.film_blocks import Told

PROBLEM = "bal/problem-49-7776-pre.txt"

OPTIMUM = 13344.26
"""Half the sum of squares that the best published solvers reach on this file."""


HUBER_OPTIMUM = 7647.944
"""The same with Huber's loss of 1 pixel, reached by `tests/campaigns/bal_with_loss.py`, which shares no code."""


@pytest.mark.slow
def test_bal_49_with_hubers_loss_reaches_the_optimum_of_an_independent_solver(shared_data: Path) -> None:
    block = read_bal(shared_data / PROBLEM)
    told = Told()
    options = BundleOptions(datum="minimal", blunders={"method": "robust", "bound": 1.0}, max_iterations=60)
    solution = bundle(block, calibrated(block), options=options, context=told)
    v = solution.residuals.residual[:, :2] / solution.residuals.sigma[:, :2]
    s = np.linalg.norm(v, axis=1)
    assert 0.5 * np.where(s > 1, 2 * s - 1, s**2).sum() <= HUBER_OPTIMUM
    assert solution.iterations <= 60
    assert len(s) == len(block.image_points)
    assert any(f"{int((s > 1).sum())} of {len(s)} observations are weighted down" in text for text in told.lines)
    assert np.isnan(solution.sigma0)
    assert np.isnan(solution.points.covariance_m2).all()
    assert any("has no finite optimum" in text for text in told.warnings)


@pytest.mark.slow
def test_bal_49_reaches_the_optimum_and_keeps_what_is_behind_the_camera(shared_data: Path) -> None:
    block = read_bal(shared_data / PROBLEM)
    told = Told()
    options = BundleOptions(datum="minimal", blunders="none", standard_deviations=False)
    solution = bundle(block, calibrated(block), options=options, context=told)
    assert 0.5 * solution.sigma0**2 * solution.redundancy <= OPTIMUM
    assert solution.iterations <= 20
    assert solution.observations == 2 * len(block.image_points)
    # without a finite optimum: points that run away along parallel rays are named, and stay in the cost
    assert any("has no finite optimum" in text for text in told.warnings)
    measured = block.image_points
    X0, R, X = solution.images.position_m, solution.images.ground_from_image, solution.points.xyz_m
    depth = -np.einsum("ni,ni->n", R[measured.image][:, :, 2], X[measured.point] - X0[measured.image])
    assert int((depth < 0).sum()) == 31
