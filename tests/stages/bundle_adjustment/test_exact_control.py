"""Control, positions and attitudes without standard deviations: a wrong one is found, right ones stay."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.codes import CONTROL
from aatri.stages.bundle_adjustment.bundle import bundle
from tests.campaigns.pair_of_the_notes import C_MM, SIGMA_MM, pair
from tests.stages.chain import run_chain, simulated
from tests.stages.hand_block import angles_deg, ground_rows, hand, read, start


def _block(*, survey_m: float, wrong_m: float = 0.0) -> Block:
    """Exact control with errors of a survey, the height of the first wrong by more."""
    known = {"full": 8, "check_full": 4}
    block = simulated(
        3, preset="uav", flight={"strips": 3, "images_per_strip": 5}, known=known, gnss={"observed": False}
    )
    ground, rng = block.ground_points, np.random.default_rng(5)
    rows = np.flatnonzero((ground.role == CONTROL).any(axis=1))
    assert block.true_points is not None
    xyz, covariance = ground.xyz_m.copy(), ground.covariance_m2.copy()
    xyz[rows] = block.true_points.xyz_m[ground.point[rows]] + survey_m * rng.standard_normal((len(rows), 3))
    xyz[rows[0], 2] += wrong_m
    covariance[rows] = 0.0
    return replace(block, ground_points=replace(ground, xyz_m=xyz, covariance_m2=covariance))


def _left_out(solution: Solution) -> list[str]:
    suspects = solution.suspects
    assert suspects is not None
    gone = (suspects.kind == "control") & np.isin(suspects.verdict, ("rejected", "undecidable"))
    return sorted(set(suspects.point[gone].tolist()))


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(("wrong_m", "factor"), [(0.0, 1.0), (0.4, 1.0), (0.4, 8.0)])
def test_the_wrong_one_goes_and_no_other(wrong_m: float, factor: float) -> None:
    """Also where the standard deviations of image points are eight times too large."""
    block = _block(survey_m=0.0, wrong_m=wrong_m)
    points = block.image_points
    block = replace(block, image_points=replace(points, sigma_mm=points.sigma_mm * factor))
    ground = block.ground_points
    first = ground.point[np.flatnonzero((ground.role == CONTROL).any(axis=1))[0]]
    solution = run_chain(block).bundle
    assert _left_out(solution) == ([str(block.points.id[first])] if wrong_m else [])


@pytest.mark.slow
def test_points_that_are_nearly_exact_stay() -> None:
    """Errors of the survey of half of what the images see."""
    assert _left_out(run_chain(_block(survey_m=0.01)).bundle) == []


def test_a_wrong_point_of_two_images_whose_points_are_all_exact_goes_and_all_others_stay(tmp_path: Path) -> None:
    """No new point says how well one is predicted: all sixty were kept, the wrong one too, at a sigma0 above 2."""
    of = pair(np.random.default_rng(2))
    n = 60
    few = of.point < n
    of = replace(of, xyz_m=of.xyz_m[:n], image=of.image[few], point=of.point[few], xy_mm=of.xy_mm[few])
    xyz = of.xyz_m + np.where(np.arange(n)[:, None] == 6, [2.0, 0.0, 0.0], 0.0)
    rows = "\n".join(f"p{k:02},{x!r},{y!r},{z!r},0,0,0" for k, (x, y, z) in enumerate(xyz.tolist()))
    noisy = of.xy_mm + SIGMA_MM * np.random.default_rng(3).standard_normal(of.xy_mm.shape)
    camera = {"principal_distance": C_MM, "format": [260, 260]}
    more = {"sigma": {"image": 1e3 * SIGMA_MM, "control": [0.02, 0.02, 0.03]}}
    block, points = read(tmp_path, of, ground=f"point,X,Y,Z,sX,sY,sZ\n{rows}\n", xy_mm=noisy, camera=camera, more=more)
    solution = bundle(block, points, start(of, block))
    assert _left_out(solution) == ["p06"]
    assert set(solution.suspects.point[solution.suspects.verdict != "readmitted"].tolist()) == {"p06"}
    assert 0.85 < solution.sigma0 < 1.15


OF = hand()


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(
    ("kind", "wrong"), [("position", "Z"), ("position", "XYZ"), ("attitude", "a1"), ("attitude", "a3")]
)
def test_a_wrong_exact_position_or_attitude_goes_alone_and_all_rays_stay(kind: str, wrong: str, tmp_path: Path) -> None:
    """Of image i1, 3 m or 0.2 degrees off, beside a right one of i4; five weighted control points."""
    names = ("X", "Y", "Z") if kind == "position" else ("a1", "a2", "a3")
    values = OF.position_m if kind == "position" else angles_deg(OF, "omega-phi-kappa")
    off = np.array([name in wrong for name in names]) * (3.0 if kind == "position" else 0.2)
    rows = [f"i{k},{','.join(map(repr, (values[k] + o).tolist()))},0,0,0" for k, o in ((1, off), (4, 0.0 * off))]
    head = ",".join(["image", *names, *(f"s{name[-1]}" for name in names)])
    noisy = OF.xy_mm + 0.005 * np.random.default_rng(3).standard_normal(OF.xy_mm.shape)
    ground = ground_rows(OF, [0, 5, 14, 24, 29])
    block, points = read(tmp_path, OF, ground=ground, exterior="\n".join([head, *rows, ""]), xy_mm=noisy)
    solution = bundle(block, points, start(OF, block))
    suspects = solution.suspects
    gone = np.isin(suspects.verdict, ("rejected", "undecidable"))
    assert list(zip(suspects.kind[gone].tolist(), suspects.image[gone].tolist())) == [(kind, "i1")]
    assert 0.85 < solution.sigma0 < 1.15
