"""A wrong control point bends the images around it: its rays, with the images held, seem as wrong as it is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.adapters.suspects import inherited
from aatri.artifacts.solution import Solution
from aatri.artifacts.suspects import Suspects
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.small_blocks import adjusted_by, flown
from tests.stages.chain import Chain, run_chain, simulated
from tests.stages.film_blocks import Told

TEST = 5.7
"""Test of the wrong one: beyond the limit, and of what nothing tells apart as much is kept."""


def _flown(seed: int) -> Chain:
    block = simulated(
        seed,
        preset="uav",
        flight={"strips": 2, "images_per_strip": 5, "cross_strips": 0},
        known={"full": 8},
        ties={"random_per_image": 40.0},
        noise={"image_um": 10.0},
    )
    return run_chain(block, BundleOptions(reliability=True))


def _with_wrong_control(chain: Chain, row: int) -> tuple[Solution, list[str]]:
    """Adjusted with one coordinate of a control point off so far that its test is `TEST`."""
    tests, residuals, ground = chain.bundle.tests, chain.bundle.residuals, chain.block.ground_points
    assert tests is not None
    at = np.flatnonzero((residuals.kind == "control") & (residuals.row == row))[0]
    axis = int(np.argmax(tests.redundancy[at]))
    sigma_m = np.sqrt(ground.covariance_m2[row, axis, axis] / tests.redundancy[at, axis])
    xyz = ground.xyz_m.copy()
    xyz[row, axis] -= (TEST - tests.test[at, axis]) * sigma_m
    block, told = replace(chain.block, ground_points=replace(ground, xyz_m=xyz)), Told()
    initial = replace(chain.strip_block, suspects=Suspects.empty())
    return bundle(block, chain.refined, initial, context=told), told.warnings


@pytest.fixture(scope="module")
def fourth() -> Chain:
    return _flown(4)


@pytest.mark.parametrize("point", range(8))
def test_wrong_control_that_its_rays_could_be_taken_for_is_told_from_them_by_the_whole_block(
    fourth: Chain, point: int
) -> None:
    row = int(np.flatnonzero((fourth.block.ground_points.role == 1).all(axis=1))[point])
    s = _with_wrong_control(fourth, row)[0].suspects
    out = s.staying_out
    assert list(zip(s.kind[out].tolist(), s.row[out].tolist())) == [("control", row)]


@pytest.mark.slow
def test_where_nothing_tells_which_all_that_may_be_wrong_are_named() -> None:
    chain = _flown(1)
    solution, warnings = _with_wrong_control(chain, 17)
    (text,) = (w for w in warnings if "nothing tells which" in w)
    assert "control GCP02" in text
    assert "image_point 0104/GCP02" in text
    assert solution.suspects.verdict.tolist() == ["kept", "kept"]


def test_a_ray_wrong_along_the_base_is_one_of_three_on_a_line_and_no_second_object_of_the_number(fourth: Chain) -> None:
    """Each of the three rays explains it as well: x = c dX / h, of two unknowns X and h three x are one too many."""
    measured, true = fourth.refined.measurements, fourth.block.true_images
    assert true is not None
    strip = fourth.block.images.strip[measured.image]
    counts = np.bincount(measured.point)
    triple = next(
        rows
        for point in np.flatnonzero(counts == 3)
        if len(set(strip[rows := np.flatnonzero(measured.point == point)].tolist())) == 1
    )
    first, middle, last = measured.image[triple]
    base, xy = true.position_m[last] - true.position_m[first], measured.xy_mm.copy()
    base = true.ground_from_image[middle].T @ base
    along = fourth.block.cameras.principal_distance_mm[0] * base[:2] + base[2] * xy[triple[1]]
    xy[triple[1]] += 0.2 * along / np.linalg.norm(along)
    wrong = replace(fourth.refined, measurements=replace(measured, xy_mm=xy))
    told = Told()
    initial = replace(fourth.strip_block, suspects=Suspects.empty())
    s = bundle(fourth.block, wrong, initial, context=told).suspects
    assert sorted(s.row[s.verdict == "undecidable"].tolist()) == triple.tolist()
    assert not [text for text in told.warnings if "more than one object" in text]


@pytest.mark.slow
def test_a_wrong_control_point_of_two_is_found_where_four_points_tie_two_strips(tmp_path: Path) -> None:
    """It outweighs all that disagrees in a robust adjustment; left out of least squares it explains everything."""
    small = flown(2, 5, seed=2, points=8)
    common = [p for p in small.xyz_m if {i[0] for i, q in small.rays if q == p} == {"1", "2"}]
    for point in common[:-4]:
        for image in [i for i, q in small.rays if q == point and i[0] == "2"]:
            del small.rays[image, point]
    small.control = {"C1": "XYZ", "C4": "XYZ"}
    small.observed = dict.fromkeys(["101", "102", "201", "204", "205"], "XYZ")
    small.xyz_m["C1"] = small.xyz_m["C1"] + np.array([0.0, 90.0, 0.0])
    done = adjusted_by("chain", small.write(tmp_path / "block")).bundle
    s = done.suspects
    assert s.point[(s.kind == "control") & s.staying_out].tolist() == ["C1"]
    assert not ((s.kind == "position") & s.staying_out).any()
    assert done.sigma0 < 1.3


@pytest.mark.slow
def test_data_snooping_begins_robustly_where_least_squares_do_not_converge(tmp_path: Path) -> None:
    """Two points at opposite ends of an image have each other's number."""
    small = flown(2, 5, seed=5)
    seen = [p for p in small.seen_by("203") if sum(q == p for _, q in small.rays) > 3]
    pairs = [(np.linalg.norm(small.rays["203", a] - small.rays["203", b]), a, b) for a in seen for b in seen if a < b]
    _, a, b = max(pairs)
    small.rays["203", a], small.rays["203", b] = small.rays["203", b], small.rays["203", a]
    done = adjusted_by("chain", small.write(tmp_path / "block"), blunders="data_snooping")
    assert done.bundle.sigma0 < 1.1
    s = done.bundle.suspects
    assert {a, b} <= set(s.point[(s.image == "203") & s.staying_out].tolist())
    assert any("the search began with a robust adjustment" in line for line in done.lines)


@pytest.mark.slow(after=1)
def test_two_control_points_of_two_that_are_exchanged_stay_out_beside_positions_on_a_line(tmp_path: Path) -> None:
    """The graph names them; taken back, they turn the strip over, and no adjustment converges."""
    small = flown(strips=1, per_strip=5)
    small.control, small.attitudes = {"C1": "XYZ", "C4": "XYZ"}, list(small.strip)
    written = small.write(tmp_path / "block") / "ground_points.csv"
    text = written.read_text().replace("C1,", "?,").replace("C4,", "C1,").replace("?,", "C4,")
    written.write_text(text)
    done = adjusted_by("graph", tmp_path / "block")
    s = done.bundle.suspects
    assert s.point[(s.kind == "control") & s.staying_out].tolist() == ["C1", "C4"]
    assert done.bundle.images.oriented.all()
    assert done.bundle.sigma0 < 1.2
    assert any("fit with their numbers exchanged" in text for text in done.warnings)
    before, _ = inherited(done.block, done.initial)
    assert before.verdict[before.kind == "control"].tolist() == ["rejected", "rejected"]
