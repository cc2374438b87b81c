"""Observations given much too exactly bend all else: their standard deviations are wrong, not what they have bent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.campaigns.legal.cell import cell_of
from tests.campaigns.legal.judged import end_of
from tests.stages.film_blocks import Told
from tests.stages.initial_orientation import unordered
from tests.stages.initial_orientation.unordered import SMALL_UAV

FLIGHT = {"strips": 3, "images_per_strip": 6}


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "times"), [(1, 100.0), (2, 100.0), (3, 100.0), (1, 1000.0), (2, 1000.0)])
def test_positions_given_far_too_exactly_keep_no_good_observation_out(seed: int, times: float) -> None:
    block = unordered.simulated(seed, **{**SMALL_UAV, "flight": FLIGHT, "ties": {"random_per_image": 25.0}})
    e, truth = block.exterior, block.true_points
    assert truth is not None
    e = replace(e, position_covariance_m2=e.position_covariance_m2 / times**2)
    points, initial = unordered.measured(block), unordered.initial_of(block)
    control = replace(block.ground_points, role=np.zeros_like(block.ground_points.role))
    told = Told()
    solution = bundle(
        replace(block, exterior=e, ground_points=control), points, initial, options=BundleOptions(), context=told
    )
    assert not solution.suspects.staying_out.any()
    (line,) = [text for text in told.warnings if "standard deviations do not fit the residuals" in text]
    assert float(line.split("): position ")[1].split(",")[0]) == pytest.approx(times, rel=0.5)
    d, C = solution.points.xyz_m[truth.point] - truth.xyz_m, solution.points.covariance_m2[truth.point]
    square = np.einsum("ni,ni->n", d, np.linalg.solve(C, d[:, :, None])[:, :, 0])
    assert square.mean() < chi2.isf(1e-4, 3)  # the errors of all points may be those of the datum


@pytest.mark.slow
@pytest.mark.parametrize(
    "cell",
    [
        "control=full positions=some attitudes=all tilt=15 camera=digital parameters=fixed sigmas=fifth wrong=few",
        "control=one positions=some attitudes=all tilt=15 camera=film parameters=removable sigmas=fifth wrong=parallel",
    ],
)
def test_seven_positions_keep_their_part_where_all_standard_deviations_are_a_fifth_of_the_right_ones(cell: str) -> None:
    """The points of an image, or a point far away, call for a robust start: it scales few positions after many rays."""
    seed = {"few": 12105, "parallel": 9558}[cell.rpartition("=")[2]]
    assert end_of(cell_of(f"{cell} seed={seed} sigmas_of=all"), "chain").outcome == "good"
