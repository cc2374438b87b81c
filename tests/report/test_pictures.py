"""Scales, pictures and lights of the report."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.adjustment.statistics.global_test import sigma0_interval
from aatri.report.drawing import svg
from aatri.report.drawing.charts import residual_histogram, sigma0_chart
from aatri.report.drawing.labels import Labels
from aatri.report.drawing.plan import block_plan, footprints
from aatri.report.drawing.residual_plots import height_bars, image_vectors, plan_vectors
from aatri.report.drawing.scales import Scale, length_text, log_scale, near, plan_of, round_below, thinned
from aatri.report.sections.tables import by_axis, without_axis
from aatri.report.view.numbers import metres, number
from tests.made_solutions import made_block, made_solution


@pytest.mark.parametrize(("value", "expected"), [(1.0, 1.0), (1.99, 1.0), (0.0049, 0.002), (730.0, 500.0), (0.2, 0.2)])
def test_round_numbers_are_one_two_five_and_not_above(value: float, expected: float) -> None:
    assert round_below(value) == pytest.approx(expected)


def test_thinning_keeps_the_ends_and_the_number() -> None:
    rows = thinned(1_000_000, 5000)
    assert (len(rows), rows[0], rows[-1]) == (5000, 0, 999_999)
    assert len(thinned(10, 5000)) == 10


def test_a_plan_has_equal_scales_and_north_up() -> None:
    plan = plan_of(np.array([[0.0, 0.0], [1000.0, 500.0]]))
    a, b, c = plan.px(np.array([[0.0, 0.0], [100.0, 0.0], [0.0, 100.0]]))
    assert b[0] - a[0] == pytest.approx(a[1] - c[1])
    assert b[0] > a[0]


def test_a_plan_of_one_point_or_a_line_is_finite() -> None:
    for xy in (np.zeros((1, 2)), np.array([[0.0, 0.0], [0.0, 10.0]])):
        assert np.isfinite(plan_of(xy).px(xy)).all()


def test_a_vertical_image_covers_its_format_times_height_over_principal_distance() -> None:
    block = made_block()
    corners = footprints(block, made_solution(block))[0]
    half = 115.0 * (400.0 - 12.0) / 150.0  # format 230 mm, c 150 mm, 388 m above the terrain
    np.testing.assert_allclose(np.ptp(corners, axis=0), 2 * half)


def test_vectors_and_bars_say_their_exaggeration() -> None:
    groups = {
        "check": (np.array([[0.0, 0.0, 0.0], [100.0, 50.0, 0.0]]), np.array([[0.1, 0.0, -0.2], [0.0, 0.1, np.nan]]))
    }
    picture, caption = plan_vectors(groups)
    assert "at 2 check points (green); the largest is 100 mm" in caption
    assert "Exaggerated" in caption
    assert "at 1 check points (green); the largest is 200 mm" in height_bars(groups)[1]
    assert "mm</text>" in picture


def test_nothing_to_draw_is_no_picture() -> None:
    assert plan_vectors({"check": (np.zeros((0, 3)), np.zeros((0, 3)))}) is None
    assert image_vectors(np.zeros((0, 2)), np.zeros((0, 2))) is None
    assert residual_histogram(np.zeros(3)) is None
    assert sigma0_chart({}) is None


def test_differences_that_are_all_zero_can_be_drawn() -> None:
    zero = {"control": (np.array([[0.0, 0.0, 0.0], [10.0, 20.0, 5.0]]), np.zeros((2, 3)))}
    assert "nan" not in plan_vectors(zero)[0]
    assert "nan" not in height_bars(zero)[0]


def test_the_mean_image_residual_of_a_constant_is_that_constant() -> None:
    rng = np.random.default_rng(5)
    _, caption = image_vectors(rng.uniform(-100, 100, (500, 2)), np.tile([0.003, -0.004], (500, 1)))
    assert "the largest is 5.00 um" in caption


def test_axes_have_round_ticks_inside() -> None:
    assert Scale(0.0, 10.0, 0.0, 100.0).ticks() == [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]
    axis = log_scale(np.array([0.5, 30.0]), 0.0, 100.0)
    assert axis.ticks() == pytest.approx([0.1, 1.0, 10.0, 100.0])
    assert axis.px(1.0) == pytest.approx(100.0 / 3)


def test_the_interval_of_sigma0_is_the_chi_square_tables() -> None:
    # chi-square quantiles for 10 degrees of freedom: 0.025 -> 3.247, 0.975 -> 20.483 (any statistics table)
    low, high = sigma0_interval(10)
    assert low == pytest.approx((3.247 / 10) ** 0.5, rel=1e-4)
    assert high == pytest.approx((20.483 / 10) ** 0.5, rel=1e-4)


def test_text_in_pictures_is_escaped_and_markup_is_not() -> None:
    assert str(svg.text(0, 0, "<b>&")) == '<text x="0.0" y="0.0" class="" text-anchor="start">&lt;b&gt;&amp;</text>'
    assert "<path" in svg.drawing(1, 1, "x", svg.dots(np.zeros((1, 2)), "a"))
    assert "<path" not in svg.drawing(1, 1, "x", "<path>")


def test_numbers_are_printed_for_reading() -> None:
    assert number(None) == number(float("nan")) == metres(float("nan")) == "–"
    assert number(1234567) == "1\u202f234\u202f567"
    assert metres(0.0123456) == "0.0123"
    assert metres(1.2e-7) == "1.2e-07"
    assert length_text(0.0467061) == "46.7 mm"
    assert length_text(2000.0) == "2 km"


def test_figures_of_the_three_axes_stand_side_by_side() -> None:
    metrics = {"check_points": 4, "check_rmse_x_m": 1.0, "check_rmse_z_m": 3.0, "truth_over_theory_y": 0.5}
    table = by_axis("", metrics)
    assert table.rows == [("check_rmse_m", "1", "–", "3"), ("truth_over_theory", "–", "0.5", "–")]
    assert without_axis(metrics) == {"check_points": 4}


def test_a_label_takes_the_first_free_place_and_is_left_out_where_there_is_none() -> None:
    labels = Labels(720.0, 400.0)
    marks, left = labels.around(np.array([[100.0, 50.0], [690.0, 50.0]]), ["A", "BBBBBB"])
    assert left == 0
    assert 'x="108.0"' in marks[0]  # right of its point
    assert 'text-anchor="end"' in marks[1]  # the right edge would cut it off
    crowd, left = Labels(720.0, 400.0).around(np.tile([[300.0, 200.0]], (10, 1)), [f"GCP{k}" for k in range(10)])
    assert (len(crowd), left) == (4, 6)


def test_a_point_far_off_does_not_set_the_scale() -> None:
    rng = np.random.default_rng(2)
    xy = rng.uniform(0, 1000, (50, 2))
    xy[7] = [90_000, 40_000]
    assert np.flatnonzero(~near(xy)).tolist() == [7]
    assert near(rng.uniform(0, 1000, (5000, 2))).all()
    assert near(np.array([[0.0, 0.0], [1e6, 0.0]])).all()  # two points have no main part


def test_points_without_height_count_for_the_extent_of_the_plan() -> None:
    """Plan control of a block without images and solution: nothing else says where it lies."""
    block = made_block()
    flat = block.ground_points.xyz_m.copy()
    flat[:, 2] = np.nan
    drawn, _ = block_plan(replace(block, ground_points=replace(block.ground_points, xyz_m=flat)), None)
    assert f">{block.points.id[block.ground_points.point[0]]}</text>" in drawn


def test_the_plan_names_control_and_what_it_leaves_out() -> None:
    block = made_block()
    far = block.ground_points.xyz_m.copy()
    far[0, :2] += [90_000.0, 50_000.0]
    solution = made_solution(block)
    xyz = solution.points.xyz_m.copy()
    first = block.ground_points.point[0]
    xyz[first] = far[0]
    solution = replace(solution, points=replace(solution.points, xyz_m=xyz))
    drawn, caption = block_plan(replace(block, ground_points=replace(block.ground_points, xyz_m=far)), solution)
    names = block.points.id[block.ground_points.point]
    assert f"not {names[0]}, which lie far off" in caption
    assert f">{names[1]}</text>" in drawn
    assert "200 m</text>" in drawn  # the scale bar of a block of some 800 m
