"""absolute_orientation/similarity on made-up free strips."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.artifacts.suspects import Suspects
from aatri.errors import ConvergenceError, GeometryError
from aatri.formats.results.solution_tables import frame_tp
from aatri.geometry.rotations import log_rotation
from aatri.stages.absolute_orientation.similarity import SimilarityOptions, similarity
from tests.made_strips import Heard, MadeBlock


def _oriented(made, **options):
    heard = Heard()
    solution = similarity(
        made.block(), made.strips(), made.image_points(), options=SimilarityOptions(**options), context=heard
    )
    return solution, heard


def _errors(made, solution):
    """Largest errors of positions (m), rotations (rad) and points (m) of what is oriented."""
    on = solution.images.oriented
    turn = log_rotation(solution.images.ground_from_image[on] @ made.truth_R[on].swapaxes(1, 2))
    return (
        np.abs(solution.images.position_m[on] - made.truth_X0[on]).max(),
        np.abs(turn).max(),
        np.nanmax(np.abs(solution.points.xyz_m - made.truth)),
    )


@pytest.mark.parametrize("n_strips", [2, 4])
def test_four_corner_points_orient_a_block_where_no_strip_has_three(n_strips: int) -> None:
    made = MadeBlock(n_strips, 5)
    made.control(made.corners())
    solution, heard = _oriented(made)
    position, rotation, point = _errors(made, solution)
    assert solution.images.oriented.all()
    assert position < 1e-6
    assert rotation < 1e-9
    assert point < 1e-6
    assert heard.warnings == []


@pytest.mark.parametrize("start", ["two_points", "centroids"])
def test_the_classical_starts_end_at_the_same_and_tell_their_frame_tp(start: str) -> None:
    """A502, A504, A607: all points in tp, whose matrix over lambda^2 brings them back to the ground."""
    made = MadeBlock(3, 5, noise_m=0.02)
    made.control([*made.corners(), 7], sigma_m=0.05)
    (closed, _), (solution, _) = _oriented(made), _oriented(made, start=start)
    np.testing.assert_allclose(solution.points.xyz_m, closed.points.xyz_m, atol=1e-5)
    value = dict(zip(solution.transformations.parameter.tolist(), solution.transformations.value.tolist()))
    a, b = value["a"], value["b"]
    assert value["lambda"] ** 2 == pytest.approx(a * a + b * b, rel=1e-12)
    frame = frame_tp(solution.transformations)
    assert frame is not None
    tp = frame.from_ground(solution.points.xyz_m[:, [1, 0, 2]]) - [value[f"{axis}1"] for axis in "XYZ"]
    plan = tp[:, :2] @ np.array([[b, a], [a, -b]]) / (a * a + b * b)
    back = np.column_stack([plan[:, 1] + value["E1_m"], plan[:, 0] + value["N1_m"], tp[:, 2] / value["lambda"]])
    back[:, 2] += value["H1_m"]
    np.testing.assert_allclose(back, solution.points.xyz_m, atol=1e-9)


def test_without_two_points_in_full_there_is_no_frame_tp_and_the_run_says_so() -> None:
    made = MadeBlock(3, 5, noise_m=0.02)
    first, second, *others = made.corners()
    made.control([first, second], (1, 1, 0), 0.05).control(others, (0, 0, 1), 0.05).control([7], sigma_m=0.05)
    solution, heard = _oriented(made, start="two_points")
    assert frame_tp(solution.transformations) is None
    assert [text for text in heard.warnings if text.startswith("no frame tp")]


def test_plan_and_height_control_and_antenna_positions_orient_together_exactly() -> None:
    made = MadeBlock(3, 5)
    a, b, c, d = made.corners()
    made.control([a, d], roles=(1, 1, 0)).control([b, c], roles=(0, 0, 1), sigma_m=0.02)
    made.positions([0, 7, 12], lever_arm_m=(0.4, -0.2, 1.1))
    solution, _ = _oriented(made)
    assert max(_errors(made, solution)) < 1e-6


def test_residuals_of_control_are_component_minus_given() -> None:
    made = MadeBlock(2, 5, noise_m=0.02)
    made.control(made.corners(), sigma_m=0.05)
    solution, _ = _oriented(made)
    block, table = made.block(), solution.residuals
    of = np.flatnonzero(table.kind == "control")
    row = table.row[of]
    expected = solution.points.xyz_m[block.ground_points.point[row]] - block.ground_points.xyz_m[row]
    np.testing.assert_allclose(table.residual[of], expected, atol=1e-8)
    assert solution.redundancy == solution.observations - solution.unknowns


def test_counts_of_image_points_are_those_of_solved_points_in_oriented_images() -> None:
    made = MadeBlock(2, 5)
    made.control(made.corners())
    solution, _ = _oriented(made)
    solved = np.isfinite(solution.points.xyz_m).all(1)
    image, point = made.rows[:, 0].astype(int), made.rows[:, 1].astype(int)
    np.testing.assert_array_equal(solution.images.image_points, np.bincount(image[solved[point]], minlength=10))
    assert (solution.points.rays[~solved] == 0).all()


def test_two_strips_with_nothing_in_common_are_an_error_that_says_why_where_all_are_asked_for() -> None:
    made = MadeBlock(2, 5, gap_m=400.0)
    low = made.truth[:, 1] < made.truth[:, 1].mean()
    made.control(np.flatnonzero(low)[::7])
    with pytest.raises(GeometryError) as raised:
        _oriented(made, components="all")
    text = str(raised.value)
    assert raised.value.exit_code == 4
    assert "component 2 (strip 2): not determined, it holds no control point" in text
    assert "strip 1 and strip 2 have no common point" in text
    assert "components: largest" in text


def test_what_can_be_oriented_is_and_the_rest_is_listed() -> None:
    made = MadeBlock(2, 5, gap_m=400.0)
    low = made.truth[:, 1] < made.truth[:, 1].mean()
    made.control(np.flatnonzero(low)[::7])
    solution, heard = _oriented(made)
    assert solution.images.oriented.tolist() == [True] * 5 + [False] * 5
    assert max(_errors(made, solution)) < 1e-6
    assert any("not oriented (5 of " in text and "images): 005" in text for text in heard.warnings)
    assert any("component 2 (strip 2)" in text for text in heard.warnings)


def test_two_components_with_control_of_their_own_are_both_oriented() -> None:
    made = MadeBlock(2, 5, gap_m=400.0)
    made.control(range(0, len(made.truth), 5))
    solution, heard = _oriented(made)
    assert solution.images.oriented.all()
    assert max(_errors(made, solution)) < 1e-6
    assert any("have no common point" in text for text in heard.warnings)


@pytest.mark.slow
@pytest.mark.parametrize("components", ["largest", "all"])
def test_a_component_whose_control_contradicts_itself_does_not_take_the_others_with_it(components: str) -> None:
    made, rng = MadeBlock(2, 5, gap_m=400.0), np.random.default_rng(1)
    low = made.truth[:, 1] < made.truth[:, 1].mean()
    high = np.flatnonzero(~low)[:: np.count_nonzero(~low) // 4][:4]
    made.control([*np.flatnonzero(low)[::5], *high], sigma_m=0.1)
    for point in high:
        roles, xyz_m, sigma_m = made.given[point]
        made.given[point] = roles, xyz_m + rng.normal(0.0, 800.0, 3), sigma_m
    if components == "all":
        with pytest.raises(ConvergenceError, match="component 2"):
            _oriented(made, components="all")
        return
    solution, heard = _oriented(made)
    assert solution.images.oriented.tolist() == [True] * 5 + [False] * 5
    assert max(_errors(made, solution)) < 1e-6
    assert any(text.startswith("not oriented: ") and "component 2 (strip 2)" in text for text in heard.warnings)


def test_too_little_and_collinear_control_is_named_with_its_points() -> None:
    made = MadeBlock(2, 5)
    a, b, _, _ = made.corners()
    made.control([a, b])
    line = f"rotation about the line through point p{min(a, b):03d} and point p{max(a, b):03d}"
    with pytest.raises(GeometryError, match=f"strips 1, 2.*not determined: {line}"):
        _oriented(made)


def test_wrong_control_becomes_a_suspect() -> None:
    made = MadeBlock(3, 6, noise_m=0.01)
    made.control(range(0, len(made.truth), 6), sigma_m=0.01)
    made.control([24], sigma_m=0.01, error_m=(0.0, 0.0, 1.5))
    solution, _ = _oriented(made)
    suspects = solution.suspects
    assert suspects.kind.tolist() == ["control"]
    assert suspects.point.tolist() == ["p024"]
    assert suspects.verdict.tolist() == ["rejected"]
    assert suspects.size[0] == pytest.approx(1.5, abs=0.1)


def test_the_result_does_not_depend_on_a_shift_of_the_map() -> None:
    made = MadeBlock(2, 5, noise_m=0.02)
    made.control(made.corners(), sigma_m=0.02)
    here, _ = _oriented(made)
    far = np.array([5.0e6, -3.0e6, 0.0])
    for p, (roles, xyz, sigma) in made.given.items():
        made.given[p] = (roles, xyz + far, sigma)
    there, _ = _oriented(made)
    np.testing.assert_allclose(there.points.xyz_m - far, here.points.xyz_m, atol=1e-7)


def test_positions_of_a_single_strip_leave_the_roll_open_and_those_of_two_strips_do_not() -> None:
    single = MadeBlock(1, 6).positions(range(6))
    with pytest.raises(GeometryError, match="rotation about the line through image 000 and image 005"):
        _oriented(single)
    both = MadeBlock(2, 6).positions(range(12))
    solution, _ = _oriented(both)
    assert max(_errors(both, solution)) < 1e-6


def test_a_wrong_position_becomes_a_suspect() -> None:
    made = MadeBlock(3, 6, noise_m=0.01)
    error = np.zeros((18, 3))
    error[8] = [4.0, 0.0, 0.0]
    made.control(range(0, len(made.truth), 6), sigma_m=0.02).positions(range(18), error_m=error)
    solution, _ = _oriented(made)
    assert solution.suspects.kind.tolist() == ["position"]
    assert solution.suspects.image.tolist() == ["008"]


def test_a_block_without_control_says_what_to_give() -> None:
    with pytest.raises(GeometryError, match="no control point and no observed position") as raised:
        _oriented(MadeBlock(2, 5))
    assert "three in height" in raised.value.remedy


def test_no_strips_at_all_is_an_error() -> None:
    made = MadeBlock(2, 5)
    made.control(made.corners())
    from dataclasses import replace

    strips = made.strips()
    empty = replace(
        strips,
        strips=type(strips.strips).empty(),
        strip_images=type(strips.strip_images).empty(),
        strip_points=type(strips.strip_points).empty(),
    )
    with pytest.raises(GeometryError, match="no strips"):
        similarity(made.block(), empty, made.image_points())


def _suspected(made, kind, row, image="", point=""):
    from dataclasses import replace

    strips = made.strips()
    one = Suspects(
        kind=[kind],
        row=[row],
        image=[image],
        point=[point],
        stage=["strip_formation"],
        size=[1.0],
        unit=["m"],
        sigma=[0.1],
        test=[10.0],
        verdict=["rejected"],
    )
    return replace(strips, suspects=one)


@pytest.mark.parametrize(("kind", "row"), [("control", 3), ("position", 2)])
@pytest.mark.parametrize("wrong", [True, False])
def test_what_an_earlier_stage_rejected_begins_outside_and_is_tested_again(kind: str, row: int, wrong: bool) -> None:
    made = MadeBlock(3, 6, noise_m=0.01)
    points = list(range(0, len(made.truth), 6))
    made.control(points, sigma_m=0.02)
    error = np.zeros((18, 3))
    if wrong and kind == "control":
        made.control([points[row]], sigma_m=0.02, error_m=(0, 0, 5.0))
    elif wrong:
        error[row] = [5.0, 0, 0]
    made.positions(range(18), error_m=error)
    solution = similarity(made.block(), _suspected(made, kind, row), made.image_points())
    suspects = solution.suspects
    assert suspects.kind.tolist() == [kind]
    assert suspects.row.tolist() == [row]
    assert suspects.verdict.tolist() == ["rejected" if wrong else "readmitted"]
    assert suspects.stage.tolist() == ["absolute_orientation"]
    assert np.isfinite(suspects.test).all()
    if wrong:
        assert suspects.size[0] == pytest.approx(5.0, abs=0.5)
        assert suspects.sigma[0] < 1.0


@pytest.mark.slow
def test_control_that_is_rejected_does_not_count_as_datum() -> None:
    made = MadeBlock(2, 6, noise_m=0.005)
    line = np.flatnonzero(np.abs(made.truth[:, 1] - made.truth[:, 1].min()) < 8)
    made.control(line, sigma_m=0.01)
    off = made.corners()[1]
    made.control([off], roles=(0, 0, 1), sigma_m=0.01)
    block, strips = made.block(), made.strips()
    row = block.ground_points.point.tolist().index(off)
    rejected = _suspected(made, "control", row, point=str(block.points.id[off]))
    made.control([off], roles=(0, 0, 1), sigma_m=0.01, error_m=(0, 0, 30.0))
    with pytest.raises(GeometryError, match="rotation about the line") as raised:
        similarity(made.block(), rejected, made.image_points())
    assert f"rejected: point p{off:03d}" in str(raised.value)
    similarity(block, strips, made.image_points())


def test_sigma0_beyond_what_deformation_explains_is_an_error() -> None:
    made = MadeBlock(3, 5, noise_m=0.02)
    made.control(made.corners(), sigma_m=0.02)
    _, heard = _oriented(made)
    assert any("95 %" in line for line in heard.lines)
    with pytest.raises(ConvergenceError, match="beyond max_sigma0"):
        _oriented(made, max_sigma0=0.1)
