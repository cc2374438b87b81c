"""Scales, pictures and lights of the report."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.adapters.interior.image_pixels import filled_cells
from aatri.adjustment.statistics.global_test import sigma0_interval
from aatri.artifacts.block import Block
from aatri.artifacts.solution import ParameterCovariances, Parameters, Solution
from aatri.artifacts.suspects import Suspects
from aatri.checks.limits import FEWEST_CELLS
from aatri.report.drawing.charts import correlation_pictures
from aatri.report.drawing.overlays import FEW
from aatri.report.drawing.picture import Marks, Picture
from aatri.report.drawing.plan import block_plan, footprints, seen_from
from aatri.report.drawing.scales import Scale, log_scale, near, plan_of, round_below, thinned
from aatri.report.drawing.svg import drawn, text
from aatri.report.drawing.ties import common_points, intersection_angles, overlap_picture, sigma_pictures
from aatri.report.plotting import plotted
from aatri.report.sections.tables import by_axis, without_axis
from aatri.report.sections.tie_points import tie_point_pictures
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
    assert str(text(0, 0, "<b>&")) == '<text x="0.0" y="0.0" text-anchor="start">&lt;b&gt;&amp;</text>'
    marks = Marks("dots", np.array([[0.0, 0.0], [9.0, 9.0]]), "red", ids=["<path>", '"'], labelled=True)
    drawing = drawn(Picture("x", "<title>", "", [marks]))
    assert "&lt;title&gt;" in drawing
    assert "<path>" not in drawing
    assert 'data-ids="&lt;path&gt;\n&#34;"' in drawing


@pytest.mark.parametrize("shape", ["dots", "triangles", "circles", "crosses", "segments", "areas"])
def test_every_mark_begins_at_its_place(shape: str) -> None:
    """The script of the page reads the places back from the path."""
    xy = np.array([[0.0, 0.0], [100.0, 50.0]])
    ends = {"segments": np.stack([xy, xy], axis=1), "areas": np.stack([xy] * 4, axis=1)}.get(shape, xy)
    drawing = drawn(Picture("x", "", "", [Marks(shape, ends, "red", ids=["a", "b"])]))
    path = next(d for d in re.findall(r'<path d="([^"]*)"[^>]*data-ids', drawing))
    places = np.array([[float(v) for v in pair] for pair in re.findall(r"M(\S+?) (-?[\d.]+)", path)])
    np.testing.assert_allclose(places, plan_of(xy, width=540.0).px(xy), atol=0.06)


def test_figures_of_the_three_axes_stand_side_by_side() -> None:
    metrics = {"check_points": 4, "check_rmse_x_m": 1.0, "check_rmse_z_m": 3.0, "truth_over_theory_y": 0.5}
    table = by_axis("", metrics)
    assert table.rows == [("check_rmse_m", "1", "–", "3"), ("truth_over_theory", "–", "0.5", "–")]
    assert without_axis(metrics) == {"check_points": 4}


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
    picture = block_plan(replace(block, ground_points=replace(block.ground_points, xyz_m=flat)), None)
    assert block.points.id[block.ground_points.point[0]] in _ids(picture, "control")


def test_the_plan_names_control_and_what_it_leaves_out() -> None:
    block = made_block()
    far = block.ground_points.xyz_m.copy()
    far[0, :2] += [90_000.0, 50_000.0]
    solution = made_solution(block)
    xyz = solution.points.xyz_m.copy()
    first = block.ground_points.point[0]
    xyz[first] = far[0]
    solution = replace(solution, points=replace(solution.points, xyz_m=xyz))
    picture = block_plan(replace(block, ground_points=replace(block.ground_points, xyz_m=far)), solution)
    names = block.points.id[block.ground_points.point]
    assert f"not {names[0]}, which lie far off" in picture.caption
    assert names[0] not in _ids(picture, "control")
    assert names[-1] in _ids(picture, "control") + _ids(picture, "check points")
    assert "200 m</text>" in drawn(picture)  # the scale bar of a block of some 800 m


def _ids(picture: Picture, name: str) -> list[str]:
    return [i for m in picture.marks if m.name == name for i in m.ids]


def test_control_that_is_left_out_is_drawn_otherwise() -> None:
    block = made_block()
    wrong = str(block.points.id[block.ground_points.point[0]])
    suspects = Suspects(
        kind=["control"],
        row=[0],
        image=[""],
        point=[wrong],
        stage=["bundle_adjustment"],
        size=[1.0],
        unit=["m"],
        sigma=[0.1],
        test=[9.0],
        verdict=["rejected"],
    )
    picture = block_plan(block, made_solution(block, suspects=suspects))
    assert _ids(picture, "control left out") == [wrong]
    assert wrong not in _ids(picture, "control")
    assert {m.shape for m in picture.marks if "control" in m.name} == {"triangles", "crosses"}


def test_points_know_the_images_that_see_them() -> None:
    """Of two images and three points; the third image is not drawn."""
    rays = (np.array([0, 1, 0, 2, 1]), np.array([4, 4, 7, 7, 9]))
    assert seen_from(rays, np.array([7, 4, 8]), np.array([1, 0])) == [[1], [1, 0], []]


def test_images_are_tied_by_their_common_points_and_rays_intersect_at_their_angles() -> None:
    block = made_block(columns=3, rows=3)
    solution = made_solution(block)
    left, right, count = common_points(block, solution)
    assert len(left) == 15  # six images, every two of them
    assert (left < right).all()
    assert (count == 9).all()
    angles = intersection_angles(block, solution)
    centres, xyz = solution.images.position_m, solution.points.xyz_m
    for of, angle in zip(xyz, angles):
        away = (centres - of) / np.linalg.norm(centres - of, axis=1)[:, None]
        assert angle == pytest.approx(np.arccos(np.min(away @ away.T)), abs=1e-9)


def test_the_overlap_counts_the_images_that_see_a_place() -> None:
    block = made_block(columns=2, rows=4)
    picture = overlap_picture(block, made_solution(block))
    assert picture is not None
    cell = np.ptp(picture.marks[0].xy[0], axis=0).prod()
    area = sum(int(re.search(r"\d+", tell)[0]) * cell for m in picture.marks for tell in m.tells)
    feet = footprints(block, made_solution(block))
    assert area == pytest.approx(len(feet) * np.ptp(feet[0], axis=0).prod(), rel=0.03)


@pytest.mark.parametrize(("sigma_m", "red"), [(0.14, ["p22"]), (0.12, [])])
def test_only_points_far_beyond_what_an_image_point_measures_are_red(sigma_m: float, red: list[str]) -> None:
    """5 um at c 150 mm from 388 m are 13 mm on the ground; ten times that is 129 mm."""
    block = made_block()
    solution = made_solution(block)
    covariance = solution.points.covariance_m2.copy()
    covariance[block.points.id == "p22", 2, 2] = sigma_m**2
    height = sigma_pictures(block, replace(solution, points=replace(solution.points, covariance_m2=covariance)))[1]
    assert [name for marks in height.marks for name in marks.ids if marks.colour == "red"] == red
    assert "measures 12.9 mm on the ground" in height.caption


def in_pixels(block: Block, **images) -> Block:
    """The block as of a digital camera of 2300 x 2300 pixels of 0.1 mm, rows down from the upper left corner."""
    of_camera = {"kind": ["digital"], "image_coordinates": ["pixel"], "pixel_size_mm": [[0.1, 0.1]]}
    of_camera |= {"pixel_origin": ["top-left-corner"], "pixel_y": ["down"], "format": [[2300.0, 2300.0]]}
    cameras = replace(block.cameras, **{name: np.array(value) for name, value in of_camera.items()})
    xy = 1150.0 + block.image_points.xy * [10.0, -10.0]
    return replace(
        block,
        cameras=cameras,
        image_points=replace(block.image_points, xy=xy),
        images=replace(block.images, **images),
    )


def _tie_point_pictures(block: Block, solution: Solution | None = None) -> dict[str, Picture]:
    made = tie_point_pictures(block, solution, common_points(block, solution))
    return {picture.name: picture for picture in made}


def test_the_cells_of_an_image_are_those_in_which_its_points_lie() -> None:
    """Of the first image all points are in the second cell from the left of the third row from below."""
    block = in_pixels(made_block(columns=9, rows=8))
    first = block.image_points.image == 0
    xy = block.image_points.xy.copy()
    xy[first] = [1.5 * 2300 / 8, 2300 - 2.5 * 2300 / 8]
    block = replace(block, image_points=replace(block.image_points, xy=xy))
    filled = filled_cells(block, block.image_points.active)
    assert np.argwhere(filled[0]).tolist() == [[2, 1]]
    picture = _tie_point_pictures(block)["cells"]
    few = [(m.ids, m.tells) for m in picture.marks if m.colour == "red" and m.ids]
    assert few == [([block.images.id[0]], ["1 of 64 cells"])]
    assert "1 of 18 images has a point in less than 30%" in picture.caption
    assert FEW == FEWEST_CELLS


def test_a_film_block_and_one_with_fewer_points_than_cells_have_no_pictures_of_cells() -> None:
    assert _tie_point_pictures(made_block(columns=9, rows=8)) == {}
    assert _tie_point_pictures(in_pixels(made_block(columns=5, rows=4))) == {}


def test_points_that_are_left_out_are_red_in_the_pair_with_most_of_them() -> None:
    block = in_pixels(made_block(columns=9, rows=8))
    solution = made_solution(block)
    at = block.image_points
    out = ((at.image == 2) & (at.point < 2)) | ((at.image == 3) & (at.point == 5))
    r = solution.residuals
    active = ~((r.kind == "image_point") & np.isin(r.row, np.flatnonzero(out)))
    pictures = _tie_point_pictures(block, replace(solution, residuals=replace(r, active=active)))
    picture = pictures["pair_left_out"]
    names = block.images.id[[2, 3]].tolist()
    assert _ids(picture, "left out") == np.repeat(block.points.id[[0, 1, 5]], 2).tolist()
    assert next(list(m.ids) for m in picture.marks if m.shape == "texts") == names
    assert picture.caption.startswith(f"{names[0]} and {names[1]}: 69 common points are used, 3 left out.")
    (green,) = (m for m in picture.marks if m.shape == "dots" and m.colour == "green")
    row = int(np.flatnonzero((at.image == 2) & (at.point == 2))[0])
    np.testing.assert_allclose(green.xy[0], [at.xy[row, 0], 2300 - at.xy[row, 1]])


def test_the_weakest_of_the_strongest_ties_is_drawn_and_the_median() -> None:
    """One image has 10 points, all others 72: its strongest tie is the weakest."""
    block = in_pixels(made_block(columns=9, rows=8))
    at = block.image_points
    active = ~((at.image == 4) & (at.point >= 10))
    pictures = _tie_point_pictures(replace(block, image_points=replace(at, active=active)))
    assert block.images.id[4] in pictures["pair_weakest"].caption
    assert ": 10 common points are used, 62 left out" in pictures["pair_weakest"].caption
    assert ": 72 common points are used, 0 left out" in pictures["pair_median"].caption


@pytest.mark.slow
def test_photographs_stand_behind_the_points_where_their_files_are_there(tmp_path: Path) -> None:
    pil = pytest.importorskip("PIL.Image", reason="pip install 'aatri[images]'")
    file = tmp_path / "a.png"
    pil.fromarray(np.full((2300, 2300), 128, np.uint8)).save(file)
    block = made_block(columns=9, rows=8)
    block = in_pixels(block, path=np.array([str(file)] + [str(tmp_path / "gone.png")] * (len(block.images) - 1)))
    picture = _tie_point_pictures(block)["pair_weakest"]
    (behind,) = picture.backdrops
    assert (behind.low.tolist(), behind.high.tolist()) == ([0.0, 0.0], [2300.0, 2300.0])
    assert pil.open(io.BytesIO(behind.jpeg)).size == (900, 900)
    assert 'href="data:image/jpeg;base64,' in drawn(picture)
    pytest.importorskip("matplotlib", reason="pip install 'aatri[plot]'")
    width, height = pil.open(io.BytesIO(plotted(picture, "png"))).size
    assert width > 1.5 * height  # a file is as wide and as high as what it shows


def test_all_correlations_are_in_the_matrix() -> None:
    parameters = Parameters(
        group=["additional"] * 2, object=["cam"] * 2, name=["k1", "p1"], value=[1.0, 1.0], sigma=[2.0, 3.0]
    )
    covariances = ParameterCovariances(first=[0, 0, 1], second=[0, 1, 1], covariance=[4.0, -4.5, 9.0])
    solution = made_solution(made_block(), parameters=parameters, parameter_covariances=covariances)
    (picture,) = correlation_pictures(solution)
    drawn_cells = [(i, t, m.colour) for m in picture.marks for i, t in zip(m.ids, m.tells)]
    assert drawn_cells == [("k1 with p1", "-0.750", "blue"), ("p1 with k1", "-0.750", "blue")]
