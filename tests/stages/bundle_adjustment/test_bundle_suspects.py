"""What earlier stages reject stays rejected in the bundle, whatever its kind, unless it fits the adjusted block."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.artifacts.solution import Solution
from aatri.artifacts.suspects import Suspects
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.stages.chain import Chain, run_chain, simulated
from tests.stages.initial_orientation.test_datum import some_ends, with_distances

BOTH = BundleOptions(interior_unknowns=True)


@pytest.fixture(scope="module")
def chain() -> Chain:
    """Two strips of four film images with five control points and observed positions."""
    return run_chain(
        simulated(
            2,
            preset="rc30",
            flight={"strips": 2, "images_per_strip": 4, "cross_strips": 0},
            known={"full": 5, "check_full": 6},
            ties={"new_points": 300},
        )
    )


def _suspected(initial: Solution, kind: str, rows: list[int]) -> Solution:
    """The solution with some observations rejected."""
    n = len(rows)
    suspects = Suspects(
        kind=[kind] * n,
        row=rows,
        image=[""] * n,
        point=[""] * n,
        stage=["absolute_orientation"] * n,
        size=[1.0] * n,
        unit=["m"] * n,
        sigma=[0.1] * n,
        test=[10.0] * n,
        verdict=["rejected"] * n,
    )
    return replace(initial, suspects=suspects)


def _verdicts(solution: Solution, kind: str) -> list[str]:
    return solution.suspects.verdict[solution.suspects.kind == kind].tolist()


def _residual(solution: Solution, kind: str, row: int) -> tuple[np.ndarray, bool]:
    r = solution.residuals
    (at,) = np.flatnonzero((r.kind == kind) & (r.row == row))
    return r.residual[at], bool(r.active[at])


def _truth_rmse_m(chain: Chain, solution: Solution) -> np.ndarray:
    truth = chain.block.true_points
    assert truth is not None
    return np.sqrt(np.nanmean((solution.points.xyz_m[truth.point] - truth.xyz_m) ** 2, axis=0))


@pytest.mark.slow
def test_a_control_point_off_by_a_metre_that_absolute_orientation_rejects_stays_rejected(chain: Chain) -> None:
    g = chain.block.ground_points
    row = int(np.flatnonzero((g.role == 1).any(axis=1))[2])
    xyz = g.xyz_m.copy()
    xyz[row, 0] += 1.0
    wrong = run_chain(replace(chain.block, ground_points=replace(g, xyz_m=xyz)))
    verdicts = {
        (str(k), int(r)): str(v)
        for k, r, v in zip(wrong.bundle.suspects.kind, wrong.bundle.suspects.row, wrong.bundle.suspects.verdict)
    }
    assert verdicts["control", row] == "rejected"
    residual, active = _residual(wrong.bundle, "control", row)
    assert not active
    np.testing.assert_allclose(residual, [-1.0, 0.0, 0.0], atol=0.15)  # adjusted minus given
    assert (_truth_rmse_m(wrong, wrong.bundle) < 1.3 * _truth_rmse_m(chain, chain.bundle) + 0.01).all()


def test_what_an_earlier_stage_kept_and_the_bundle_rejects_is_rejected(chain: Chain) -> None:
    g = chain.block.ground_points
    row = int(np.flatnonzero((g.role == 1).any(axis=1))[2])
    xyz = g.xyz_m.copy()
    xyz[row, 0] += 1.0
    block = replace(chain.block, ground_points=replace(g, xyz_m=xyz))
    kept = _suspected(chain.strip_block, "control", [row])
    kept = replace(kept, suspects=replace(kept.suspects, verdict=np.array(["kept"])))
    assert _verdicts(bundle(block, chain.refined, kept, options=BOTH), "control") == ["rejected"]


def test_wrong_distances_between_points_and_from_an_image_stay_rejected_together(chain: Chain) -> None:
    block = with_distances(chain.block, some_ends(chain.block, 4), wrong_m=50.0)
    g, images, points = block.geodetic, block.true_images, block.true_points
    assert images is not None
    assert points is not None
    at = [points.xyz_m[block.points.id.tolist().index(end)] for end in g.end[2:]]
    kind, start, value = g.start_kind.astype("U5"), g.start.astype("U16"), g.value.copy()
    kind[2:], start[2:] = "image", block.images.id[:2]
    value[2:] = np.linalg.norm(images.position_m[:2] - at, axis=1) + np.array([50.0, 0.0])
    block = replace(block, geodetic=replace(g, start_kind=kind, start=start, value=value))
    solution = bundle(block, chain.refined, _suspected(chain.strip_block, "distance", [1, 2]), options=BOTH)
    assert _verdicts(solution, "distance") == ["rejected", "rejected"]
    np.testing.assert_allclose(solution.suspects.size[solution.suspects.kind == "distance"], 50.0, atol=0.5)


@pytest.mark.parametrize("exact", [False, True])
def test_rejected_control_that_is_wrong_stays_out_and_that_fits_comes_back(chain: Chain, exact: bool) -> None:
    g = chain.block.ground_points
    rows = np.flatnonzero((g.role == 1).any(axis=1))
    good, bad = int(rows[1]), int(rows[3])
    xyz, covariance = g.xyz_m.copy(), g.covariance_m2.copy()
    xyz[bad, 2] += 2.0
    if exact:
        truth = chain.block.true_points
        assert truth is not None
        covariance[good] = covariance[bad] = 0.0
        xyz[good] = truth.xyz_m[np.flatnonzero(truth.point == g.point[good])[0]]
    block = replace(chain.block, ground_points=replace(g, xyz_m=xyz, covariance_m2=covariance))
    solution = bundle(block, chain.refined, _suspected(chain.strip_block, "control", [good, bad]), options=BOTH)
    assert _verdicts(solution, "control") == ["readmitted", "rejected"]
    assert _residual(solution, "control", good)[1]
    residual, active = _residual(solution, "control", bad)
    assert not active
    assert residual[2] == pytest.approx(-2.0, abs=0.3)


def test_a_rejected_position_stays_out_and_one_that_fits_comes_back(chain: Chain) -> None:
    e = chain.block.exterior
    position = e.position_m.copy()
    position[4, 1] += 5.0
    block = replace(chain.block, exterior=replace(e, position_m=position))
    solution = bundle(block, chain.refined, _suspected(chain.strip_block, "position", [4, 6]), options=BOTH)
    assert _verdicts(solution, "position") == ["rejected", "readmitted"]
    assert _residual(solution, "position", 4)[0][1] == pytest.approx(-5.0, abs=0.3)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("k1", [2e-8, 5e-8])
def test_rays_far_out_that_fit_with_the_distortion_of_the_adjustment_are_readmitted(chain: Chain, k1: float) -> None:
    m = chain.refined.measurements
    r2 = (m.xy_mm**2).sum(axis=1)
    xy = m.xy_mm - k1 * r2[:, None] * m.xy_mm  # the set adds k1 r^2 x to the measurement
    points = replace(chain.refined, measurements=replace(m, xy_mm=xy))
    far = np.flatnonzero((r2 > 110.0**2) & m.active)
    rejected = np.random.default_rng(3).permutation(far)[:20].tolist()
    options = BundleOptions(interior_unknowns=True, self_calibration={"set": "brown_conrady"})
    solution = bundle(chain.block, points, _suspected(chain.strip_block, "image_point", rejected), options=options)
    assert (solution.suspects.verdict == "readmitted").sum() >= 19


def test_control_seen_in_one_image_takes_part_although_initial_does_not_know_it(chain: Chain) -> None:
    g, m = chain.block.ground_points, chain.refined.measurements
    row = int(np.flatnonzero((g.role == 1).any(axis=1))[0])
    point = int(g.point[row])
    once = m.active.copy()
    once[np.flatnonzero((m.point == point) & m.active)[1:]] = False
    xyz = chain.strip_block.points.xyz_m.copy()
    xyz[point] = np.nan
    initial = replace(chain.strip_block, points=replace(chain.strip_block.points, xyz_m=xyz), suspects=Suspects.empty())
    points = replace(chain.refined, measurements=replace(m, active=once))
    solution = bundle(chain.block, points, initial, options=BOTH)
    assert np.isfinite(solution.points.xyz_m[point]).all()
    assert _residual(solution, "control", row)[1]
