"""Charts: what they say of what they were made of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.artifacts.solution import Iterations
from aatri.report.drawing.charts import iterations_chart, residual_histogram, sigma0_chart
from aatri.report.drawing.labels import AWAY_PX, CHARACTER_PX, LINE_PX, Labels
from aatri.report.drawing.ties import sigma_pictures, ties_picture
from tests.made_solutions import made_block, made_solution


def test_sigma0_stands_on_a_logarithmic_axis_each_stage_in_a_row_of_its_own() -> None:
    sigma0 = {"models": 1.0, "absolute": 10.0, "bundle": 0.0}
    picture = sigma0_chart(sigma0)
    assert picture is not None
    _, bars, dots, _ = picture.marks
    np.testing.assert_allclose(dots.xy, [[1.0, 3.0], [10.0, 2.0], [1e-12, 1.0]])
    np.testing.assert_allclose(bars.xy[:, 0, 0], 1.0)
    assert picture.across.logarithmic
    assert picture.up.names == {3.0: "models", 2.0: "absolute", 1.0: "bundle"}
    assert sigma0_chart({}) is None


def test_iterations_tell_sigma0_and_the_length_of_the_step() -> None:
    history = Iterations(cost=[400.0, 100.0], decrement=[30.0, np.nan], damping=[0.0, 0.0])
    picture = iterations_chart(made_solution(made_block(), history=history, redundancy=100))
    assert picture is not None
    curve, _, steps, _ = picture.marks
    np.testing.assert_allclose(curve.xy, [[1.0, 2.0], [2.0, 1.0]])
    np.testing.assert_allclose(steps.xy, [[1.0, 30.0]])
    assert iterations_chart(made_solution(made_block(), history=history.take([0]))) is None


def test_the_histogram_has_the_area_of_the_normal_curve_and_its_shape() -> None:
    picture = residual_histogram(np.append(np.random.default_rng(3).standard_normal(200_000), [5.1, -6.0]))
    assert picture is not None
    columns, curve = picture.marks
    heights = columns.xy[:, 2, 1]
    assert np.sum(heights * np.ptp(columns.xy[..., 0], axis=1)) == pytest.approx(1.0, abs=1e-4)
    middle = columns.xy[..., 0].mean(axis=1)
    np.testing.assert_allclose(heights, np.exp(-0.5 * middle**2) / np.sqrt(2 * np.pi), atol=0.01)
    assert curve.xy[:, 1].max() == pytest.approx(1 / np.sqrt(2 * np.pi))
    assert "(200,002)" in picture.caption
    assert "2 beyond 5." in picture.caption
    assert residual_histogram(np.zeros(3)) is None


# Labels in pictures: within it to the last pixel, and never over each other; what legends call their classes.


WIDE = 3 * CHARACTER_PX


@pytest.mark.parametrize(("off_px", "written"), [(0.0, 1), (0.01, 0)])
def test_a_label_lies_within_the_picture_and_may_touch_its_edge(off_px: float, written: int) -> None:
    size = (AWAY_PX + WIDE - off_px, LINE_PX + 5.0)  # room on the right, and nowhere else
    assert len(Labels(*size).around(np.array([[0.0, 10.0]]), ["abc"])) == written


def test_a_label_takes_the_first_free_side_and_those_without_room_are_left_out() -> None:
    written = Labels(200.0, 100.0).around(np.full((6, 2), 50.0), ["abc"] * 6)
    assert written == [
        (50 + AWAY_PX, 53.0, "start", "abc"),
        (50 - AWAY_PX, 53.0, "end", "abc"),
        (50.0, 50 - AWAY_PX, "middle", "abc"),
        (50.0, 50 + AWAY_PX + LINE_PX - 3, "middle", "abc"),
    ]


def test_marks_are_not_written_over() -> None:
    labels = Labels(200.0, 100.0)
    labels.keep_free(np.array([[50.0 + AWAY_PX + WIDE, 50.0]]), 4.0)
    assert labels.around(np.array([[50.0, 50.0]]), ["abc"])[0][2] == "end"


def test_classes_of_a_legend_differ_by_their_names_and_one_is_no_range() -> None:
    """Ties of 1, 23 and 24 points; standard deviations between 12.40 and 12.55 mm."""
    block = made_block(columns=4)
    pairs = (np.array([0, 0, 0, 1, 1, 2]), np.array([1, 2, 3, 2, 3, 3]), np.array([1, 1, 23, 23, 24, 24]))
    solution = made_solution(block)
    ties = ties_picture(block, solution, pairs)
    assert ties is not None
    names = [marks.name for marks in ties.marks if marks.shape == "segments"]
    assert names == ["1 to 5 common points", "6 to 22 common points", "23 common points", "24 or more"]
    assert list(ties.marks[0].tells) == ["1 common point"] * 2
    covariance = np.einsum("n,ij->nij", np.linspace(12.40e-3, 12.55e-3, len(block.points)) ** 2, np.eye(3))
    _, height = sigma_pictures(block, replace(solution, points=replace(solution.points, covariance_m2=covariance)))
    classes = [marks.name for marks in height.marks]
    assert len(set(classes)) == len(classes)
    assert "12.42 mm to 12.44 mm" in classes
