"""Reliability of a whole block: identities and calibration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.artifacts.solution import Solution
from aatri.report.sections.reliability import reliability_tables
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.stages.chain import Chain, run_chain, simulated

SMALL = {
    "preset": "rc30",
    "flight": {"strips": 3, "images_per_strip": 5, "cross_strips": 1},
    "ties": {"new_points": 250},
    "known": {"full": 12},
}


@pytest.fixture(scope="module")
def solution() -> Solution:
    return run_chain(simulated(**SMALL), BundleOptions(reliability=True)).bundle


def test_redundancy_numbers_sum_to_the_redundancy(solution: Solution) -> None:
    assert solution.tests is not None
    r = solution.tests.redundancy
    assert np.nansum(r) == pytest.approx(solution.redundancy, abs=1e-8 * solution.redundancy)
    assert ((r[np.isfinite(r)] >= 0) & (r[np.isfinite(r)] <= 1)).all()


def test_every_observation_has_its_row(solution: Solution) -> None:
    assert solution.tests is not None
    assert len(solution.tests) == len(solution.residuals)
    observed = np.isfinite(solution.residuals.residual)
    assert (np.isfinite(solution.tests.redundancy) == observed).all()


def test_without_gross_errors_the_tests_are_standard_normal(solution: Solution) -> None:
    assert solution.tests is not None
    w = solution.tests.test[np.isfinite(solution.tests.test)]
    # some 2,500 correlated values of about 1,200 degrees of freedom: 4 sigma of the mean square are 0.16
    assert (w**2).mean() == pytest.approx(1.0, abs=0.16)
    assert np.abs(w).max() < 4.5


def test_reliability_is_opt_in() -> None:
    assert run_chain(simulated(**SMALL)).bundle.tests is None


@pytest.fixture(scope="module")
def film() -> Chain:
    """Film with affine unknowns, positions with drift, self-calibration: priors are observations too. Without errors,
    so that the curvature of the equations, which no linear theory has, meets no residuals."""
    block = simulated(**SMALL, noise={"factor": 0.0})
    group = np.where(np.isfinite(block.exterior.position_m[:, 0]), "gps", "")
    block = replace(block, exterior=replace(block.exterior, drift_group=group.astype(np.str_)))
    return run_chain(block, BundleOptions(reliability=True, interior_unknowns=True, self_calibration="brown_conrady"))


def test_with_priors_drift_and_self_calibration_the_numbers_sum_to_the_redundancy(film: Chain) -> None:
    solution = film.bundle
    assert solution.tests is not None
    assert {"film_prior", "position"} <= set(solution.residuals.kind.tolist())
    total = np.nansum(solution.tests.redundancy)
    assert total == pytest.approx(solution.redundancy, abs=1e-7 * solution.redundancy)


def test_an_error_of_the_detectable_size_moves_point_and_image_as_predicted(film: Chain) -> None:
    """One coordinate of an image point is changed and the block adjusted anew."""
    solution, tests = film.bundle, film.bundle.tests
    assert tests is not None
    kind = solution.residuals.kind
    options = BundleOptions(interior_unknowns=True, self_calibration="brown_conrady", tolerance=1e-7)
    before = bundle(film.block, film.refined, solution, options=options)
    image_points = np.flatnonzero((kind == "image_point") & np.isfinite(tests.detectable[:, 0]))
    for k in (int(image_points[7]), int(image_points[200])):
        row, part = int(solution.residuals.row[k]), 1e-3  # so small that the block stays linear
        xy = film.refined.measurements.xy_mm.copy()
        xy[row, 0] += part * tests.detectable[k, 0]
        changed = replace(film.refined, measurements=replace(film.refined.measurements, xy_mm=xy))
        after = bundle(film.block, changed, solution, options=options)
        i = int(np.flatnonzero(film.block.images.id == solution.residuals.image[k])[0])
        p = int(np.flatnonzero(film.block.points.id == solution.residuals.point[k])[0])
        shift = np.linalg.norm(after.points.xyz_m[p] - before.points.xyz_m[p]) / part
        assert tests.point_moved_m[k, 0] == pytest.approx(shift, rel=1e-3)
        shift = np.linalg.norm(after.images.position_m[i] - before.images.position_m[i]) / part
        assert tests.image_moved_m[k, 0] == pytest.approx(shift, rel=1e-3)
        R = after.images.ground_from_image[i] @ before.images.ground_from_image[i].T
        turn = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
        assert tests.image_turned_rad[k, 0] == pytest.approx(np.linalg.norm(turn) / part, rel=1e-3)


def test_x_of_points_in_two_images_along_the_flight_is_listed_as_uncontrolled(solution: Solution) -> None:
    page = "".join(str(table) for table in reliability_tables(solution))
    assert "Uncontrolled" in page
