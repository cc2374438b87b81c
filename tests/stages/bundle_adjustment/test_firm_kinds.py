"""Observations given much too exactly bend all else: their standard deviations are wrong, not what they have bent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.stages.film_blocks import Told
from tests.stages.initial_orientation import unordered
from tests.stages.initial_orientation.unordered import SMALL_UAV

FLIGHT = {"strips": 3, "images_per_strip": 6}


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_positions_given_a_hundred_times_too_exactly_keep_no_good_observation_out(seed: int) -> None:
    block = unordered.simulated(seed, **{**SMALL_UAV, "flight": FLIGHT, "ties": {"random_per_image": 25.0}})
    e, truth = block.exterior, block.true_points
    assert truth is not None
    e = replace(e, position_covariance_m2=1e-4 * e.position_covariance_m2)
    points, initial = unordered.measured(block), unordered.initial_of(block)
    control = replace(block.ground_points, role=np.zeros_like(block.ground_points.role))
    told = Told()
    solution = bundle(
        replace(block, exterior=e, ground_points=control), points, initial, options=BundleOptions(), context=told
    )
    assert not solution.suspects.staying_out.any()
    (line,) = [text for text in told.warnings if "standard deviations do not fit the residuals" in text]
    assert float(line.split("): position ")[1].split(",")[0]) == pytest.approx(100.0, rel=0.5)
    d, C = solution.points.xyz_m[truth.point] - truth.xyz_m, solution.points.covariance_m2[truth.point]
    square = np.einsum("ni,ni->n", d, np.linalg.solve(C, d[:, :, None])[:, :, 0])
    assert square.mean() < chi2.isf(1e-4, 3)  # the errors of all points may be those of the datum
