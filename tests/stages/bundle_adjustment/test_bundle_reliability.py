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


@pytest.fixture(scope="module")
def chain() -> Chain:
    return run_chain(simulated(**SMALL))


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


def test_reliability_is_opt_in(chain: Chain) -> None:
    assert chain.bundle.tests is None


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


@pytest.mark.slow
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


def test_image_points_of_points_of_two_rays_are_listed_as_uncontrolled(chain: Chain) -> None:
    """By default; nothing else of a point is known than its two rays: of four coordinates one is redundant."""
    found, m = chain.bundle.uncontrolled, chain.refined.measurements
    assert found is not None
    assert chain.bundle.tests is None
    listed = set(found.row[found.kind == "image_point"].tolist())
    g = chain.block.ground_points
    given = np.isin(m.point, g.point[(g.role == 1).any(axis=1)])
    used = staying_in(chain)
    rays = np.bincount(m.point[used], minlength=len(chain.block.points))[m.point]
    two = np.flatnonzero(used & (rays == 2) & ~given)
    assert len(two) > 50
    assert set(two.tolist()) <= listed
    assert not set(np.flatnonzero(used & (rays >= 4)).tolist()) & listed
    assert np.abs(found.redundancy[np.isin(found.row, two) & (found.kind == "image_point")]).max() < 1e-8
    page = "".join(str(table) for table in reliability_tables(chain.bundle))
    assert "Observations that nothing controls" in page


def staying_in(chain: Chain) -> np.ndarray:
    out = chain.bundle.suspects
    return chain.refined.measurements.active & ~np.isin(
        np.arange(len(chain.refined.measurements)), out.row[(out.kind == "image_point") & out.staying_out]
    )


@pytest.mark.slow
def test_an_error_in_an_uncontrolled_direction_changes_no_residual_and_one_across_it_does(chain: Chain) -> None:
    found, m = chain.bundle.uncontrolled, chain.refined.measurements
    assert found is not None
    rows = np.flatnonzero((found.kind == "image_point") & (np.abs(found.redundancy) < 1e-8))
    k, d = found.row[rows[3]], found.direction[rows[3], :2]

    def squares(error: np.ndarray) -> float:
        xy = m.xy_mm.copy()
        xy[k] += error
        points = replace(chain.refined, measurements=replace(m, xy_mm=xy))
        options = BundleOptions.model_validate({"blunders": "none"})
        solution = bundle(chain.block, points, chain.bundle, options=options)
        return solution.sigma0**2 * solution.redundancy

    clean, size = squares(np.zeros(2)), 20 * 0.005  # of 20 standard deviations
    assert squares(size * d) == pytest.approx(clean, abs=0.5)
    assert squares(size * np.array([-d[1], d[0]])) > clean + 0.2 * 20**2
