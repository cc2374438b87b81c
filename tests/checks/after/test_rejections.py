"""What is rejected is told by name and size; exchanged numbers are recognised, mere blunders are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.adapters.solution import suspect_rows
from aatri.artifacts.residuals import Residuals
from aatri.artifacts.solution import ProposedNumbers
from aatri.artifacts.suspects import Suspects
from aatri.checks.after.rejections import (
    control_left_behind,
    exchanged_numbers,
    exchanged_proposals,
    rejections,
    two_objects,
)
from aatri.observations.control import control_of
from aatri.orientation.bundle.adjust import adjust_bundle
from tests.made_solutions import made_block, made_solution
from tests.orientation.bundle.made_bundle import made_bundle
from tests.orientation.bundle.parts import settings


def _suspects() -> Suspects:
    n = 4
    return Suspects(
        kind=np.array(["control", "control", "image_point", "control"]),
        row=np.arange(n, dtype=np.int32),
        image=np.array(["", "", "i1", ""]),
        point=np.array(["A", "B", "p", "C"]),
        stage=np.array(["absolute_orientation"] * 3 + ["strip_formation"]),
        size=np.array([0.5, 2.0, 0.03, 9.0]),
        unit=np.array(["m", "m", "mm", "m"]),
        sigma=np.full(n, 0.1),
        test=np.array([5.0, 20.0, 6.0, 90.0]),
        verdict=np.array(["rejected", "rejected", "kept", "rejected"]),
    )


def test_rejections_of_the_stage_are_warnings_the_largest_first() -> None:
    (finding,) = rejections(_suspects(), "absolute_orientation")
    assert finding.level == "warning"
    assert str(finding) == "control: 2 rejected as gross errors: B (2 m, 20 sigma), A (0.5 m, 5 sigma)"
    assert finding.rows["control"].tolist() == [1, 0]


def _rejected(
    given: np.ndarray, seen: np.ndarray, rows: list[int], before: list[int] | None = None
) -> list[tuple[str, ...]]:
    """Ids of exchanged control points, the first rows given and found elsewhere."""
    block = made_block()
    control = control_of(block)
    xyz = block.ground_points.xyz_m.copy()
    n = len(given)
    xyz[control.row[:n]] = given
    block = replace(block, ground_points=replace(block.ground_points, xyz_m=xyz))
    residuals = Residuals(
        kind=np.full(n, "control"),
        row=control.row[:n],
        image=np.full(n, ""),
        point=block.points.id[control.point[:n]],
        residual=seen - given,
        sigma=np.full((n, 3), 0.01),
        active=~np.isin(np.arange(n), rows),
        unit=np.full(n, "m"),
    )
    of_before = np.array(before or [], dtype=int)
    named = {"image": np.full(len(of_before), ""), "point": residuals.point[of_before]}
    earlier = suspect_rows("absolute_orientation", "control", row=residuals.row[of_before], **named)
    return [f.ids for f in exchanged_numbers(block, made_solution(block, residuals=residuals), earlier)]


def test_exchanged_numbers_are_recognised_and_single_blunders_are_not() -> None:
    seen = np.array([[0.0, 0, 0], [500, 0, 10], [0, 400, 5], [500, 400, 8]])
    block = made_block()
    names = block.points.id[control_of(block).point[:2]]
    assert _rejected(seen[[1, 0, 2, 3]] + 0.02, seen, [0, 1]) == [tuple(names.tolist())]
    assert _rejected(seen + np.array([[3.0, 0, 0], [0, 9.0, 0], [0, 0, 0], [0, 0, 0]]), seen, [0, 1]) == []
    assert _rejected(seen[[1, 0, 2, 3]] + 0.02, seen, []) == []


def test_what_an_earlier_stage_has_told_is_not_told_again() -> None:
    seen = np.array([[0.0, 0, 0], [500, 0, 10], [0, 400, 5], [500, 400, 8]])
    assert _rejected(seen[[1, 0, 2, 3]] + 0.02, seen, [0, 1], before=[0, 1]) == []
    assert len(_rejected(seen[[1, 0, 2, 3]] + 0.02, seen, [0, 1], before=[0])) == 1


def test_control_that_is_measured_and_takes_no_part_is_named() -> None:
    block = made_block()
    (finding,) = control_left_behind(block, made_solution(block, residuals=Residuals.empty()), Suspects.empty())
    assert len(finding.ids) == len(control_of(block).point)
    assert "in no model, 10 images show it" in finding.ids[0]


def test_control_that_only_images_show_that_are_not_oriented_is_not_said_to_lack_a_second_image() -> None:
    """A strip that is left out takes its control with it: its images are named, and more measurements help nothing."""
    block = made_block()
    made = made_solution(block, residuals=Residuals.empty())
    nowhere = replace(made.images, oriented=np.zeros(len(block.images), dtype=bool))
    assert control_left_behind(block, replace(made, images=nowhere), Suspects.empty()) == []


def test_exchanged_control_is_told_once() -> None:
    """By the stage that rejected both; image points, of which no stage before says so, always."""
    proposed = ProposedNumbers(
        kind=["control", "control", "image_point", "image_point"],
        row=[3, 5, 11, 12],
        image=["", "", "i1", "i1"],
        point=["b", "a", "p", "q"],
        proposed=["a", "b", "q", "p"],
        exchanged=[True] * 4,
    )
    texts = [(n.text, n.ids) for n in exchanged_proposals(proposed, Suspects.empty())]
    told = "these two fit if their numbers are exchanged"
    assert texts == [(f"control: {told}", ("a", "b")), (f"image_point: {told}", ("i1/p", "i1/q"))]
    both = replace(_suspects(), row=np.array([3, 5, 11, 9], dtype=np.int32))
    assert [n.ids for n in exchanged_proposals(proposed, both)] == [("i1/p", "i1/q")]
    one = replace(_suspects(), row=np.array([3, 6, 11, 9], dtype=np.int32))
    assert len(exchanged_proposals(proposed, one)) == 2


def _objects(*, together: bool, none_used: bool = False, error_mm: float = 5.0, seed: int = 1) -> tuple[str, ...]:
    """What is said of p, seen by all six images: rays of three are left out, of q, or each with an error of its own."""
    parts = made_bundle()
    rays, count = parts.rays, np.bincount(parts.rays.point)
    p, q = np.flatnonzero(count == 6)[:2]
    of_p = np.flatnonzero(rays.point == p)
    wrong, xy_mm = of_p[3:], rays.xy_mm.copy()
    errors = np.random.default_rng(seed).uniform(-error_mm, error_mm, (3, 2))
    xy_mm[wrong] = rays.xy_mm[np.flatnonzero(rays.point == q)[3:]] if together else xy_mm[wrong] + errors
    block = replace(parts, rays=replace(rays, xy_mm=xy_mm)).together()
    out = np.isin(np.arange(len(rays.point)), of_p if none_used else wrong)
    left_out = tuple(o.without(out) if o.kind == "image_point" else o for o in block.observed)
    inputs = replace(block, observed=left_out)
    result = adjust_bundle(inputs, settings(datum="free"))
    findings = two_objects(inputs.rays, inputs.image_ids, inputs.point_ids, result)
    return tuple(name.split(" ")[0] for finding in findings for name in finding.ids)


def test_a_number_of_two_points_is_told_as_such_and_errors_of_single_rays_are_not() -> None:
    p = (f"p{np.flatnonzero(np.bincount(made_bundle().rays.point) == 6)[0]}",)
    assert _objects(together=True) == p
    assert _objects(together=True, none_used=True) == p
    assert _objects(together=False) == ()
    assert _objects(together=False, none_used=True) == ()


@pytest.mark.parametrize("seed", range(5))
def test_rays_that_are_just_beyond_the_limit_are_no_second_object(seed: int) -> None:
    """Errors of some 7 standard deviations: two rays take up most of theirs, and so three of them often meet."""
    assert _objects(together=False, error_mm=0.1, seed=seed) == ()
