"""Vectors and bars of differences: direction, common scale and key; footprints and points in the plan."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from aatri.codes import CHECK, CONTROL
from aatri.report.drawing.picture import Picture
from aatri.report.drawing.plan import block_plan, footprints
from aatri.report.drawing.vectors import height_bars, image_vectors, plan_vectors, tie_pictures
from tests.made_solutions import made_block, made_solution

XYZ_M = np.array([[0.0, 0.0, 5.0], [1000.0, 0.0, 5.0], [1000.0, 600.0, 5.0], [0.0, 600.0, 5.0]])
IDS = list("abcd")


def _vectors(picture: Picture) -> np.ndarray:
    """Vectors in the unit of the key (n, 2)."""
    ends = next(m.xy for m in picture.marks if m.shape == "segments")
    number, unit = picture.key[1].split()
    return (ends[:, 1] - ends[:, 0]) / picture.key[0] * float(number) * {"um": 1e-6, "mm": 1e-3, "m": 1.0}[unit]


def _times(picture: Picture) -> float:
    return float(re.search(r"Exaggerated ([\d,.]+) times", picture.caption)[1].replace(",", ""))


def test_plan_vectors_point_where_the_differences_do_in_the_scale_of_the_key() -> None:
    d = np.array([[0.03, 0.0, 9.0], [0.0, 0.04, 9.0], [-0.05, 0.0, 9.0], [0.0, -0.02, np.nan]])
    picture = plan_vectors("differences", {"control": (XYZ_M, d, IDS)})
    np.testing.assert_allclose(_vectors(picture), d[:, :2], atol=1e-12)
    lines, dots = picture.marks
    np.testing.assert_allclose(lines.xy[:, 1] - lines.xy[:, 0], _times(picture) * d[:, :2])
    np.testing.assert_array_equal(dots.xy, XYZ_M[:, :2])
    assert list(dots.ids) == IDS
    assert "at 4 control points; the largest is 50 mm" in picture.caption
    assert picture.name == "differences_plan"


def test_many_vectors_are_drawn_half_as_long() -> None:
    rng = np.random.default_rng(2)
    drawn = []
    for n in (290, 310):
        xyz = np.column_stack([rng.permutation(n) * 10.0, rng.permutation(n) * 10.0, np.zeros(n)])
        drawn.append(_times(plan_vectors("x", {"new": (xyz, np.tile([0.024, 0.032, 0.0], (n, 1)), ["p"] * n)})))
    assert drawn[1] < drawn[0]


def test_bars_go_up_where_the_height_is_too_large() -> None:
    d = np.array([[9.0, 9.0, 0.03], [np.nan, 9.0, -0.05], [9.0, 9.0, np.nan], [9.0, 9.0, 0.0]])
    picture = height_bars("x", {"check": (XYZ_M, d, IDS)})
    np.testing.assert_allclose(_vectors(picture), [[0, 0.03], [0, -0.05], [0, 0]], atol=1e-12)
    assert "at 3 check points; the largest is 50 mm" in picture.caption


def test_points_far_off_are_left_out_and_counted() -> None:
    rng = np.random.default_rng(1)
    xyz, d = np.column_stack([rng.uniform(0, 1000, (40, 2)), np.zeros(40)]), np.full((40, 3), 0.01)
    xyz[5, 0], d[5] = 90_000.0, 0.7
    picture = plan_vectors("x", {"new": (xyz, d, [str(k) for k in range(40)])})
    assert [len(m.xy) for m in picture.marks] == [39, 39]
    assert "Not drawn: 1 point that lies far off." in picture.caption
    assert "the largest is 990 mm" in picture.caption  # said, though it is not drawn


def test_nothing_is_no_picture_and_differences_of_zero_are_one() -> None:
    assert plan_vectors("x", {"check": (np.zeros((0, 3)), np.zeros((0, 3)), [])}) is None
    assert image_vectors("c", np.zeros((0, 2)), np.zeros((0, 2))) is None
    picture = plan_vectors("x", {"control": (XYZ_M, np.zeros((4, 3)), IDS)})
    assert all(np.isfinite(m.xy).all() for m in picture.marks)


def test_cells_of_the_format_show_their_own_mean() -> None:
    rng = np.random.default_rng(2)
    xy = rng.uniform(-100.0, 100.0, (20_000, 2))
    residual = np.where(xy[:, :1] > 0, [[0.004, 0.0]], [[0.0, 0.002]]) + 0.0005 * rng.standard_normal((20_000, 2))
    picture = image_vectors("cam", xy, residual)
    right = picture.marks[-1].xy[:, 0] > 0
    assert right.sum() == 72
    np.testing.assert_allclose(_vectors(picture)[right], np.tile([4e-6, 0.0], (72, 1)), atol=3e-7)
    np.testing.assert_allclose(_vectors(picture)[~right], np.tile([0.0, 2e-6], (72, 1)), atol=3e-7)
    assert "12 x 12 cells" in picture.caption
    assert "13" in re.search(r", (\d+) points a cell", picture.caption)[1]


def test_each_strip_has_its_tie_residuals_in_plan_and_height() -> None:
    d = np.array([[0.03, 0.0, 0.1], [0.0, 0.04, 0.1], [-0.05, 0.0, -0.1], [0.0, -0.02, -0.1]])
    pictures = tie_pictures({"1": (XYZ_M, d, IDS), "2": (XYZ_M, 2 * d, IDS)}, 0)
    assert [p.name for p in pictures] == ["ties_1_plan", "ties_1_height", "ties_2_plan", "ties_2_height"]
    assert "RMS X 29.2 mm, Y 22.4 mm, Z 100 mm" in pictures[0].caption  # roots of 0.0034/4, 0.002/4, 0.01
    assert _vectors(pictures[1])[:, 1] == pytest.approx(d[:, 2])


def test_a_vector_that_would_leave_the_picture_is_cut_short_and_the_caption_says_so() -> None:
    xyz = np.array([[0.0, 0, 0], [100, 0, 0], [0, 100, 0], [100, 100, 0], [50, 50, 0]])
    d = np.full((5, 3), 0.01)
    groups = {"control": (xyz[:4], d[:4], list("abcd")), "control left out": (xyz[4:], 100 * d[4:], ["e"])}
    picture = plan_vectors("differences", groups)
    assert picture is not None
    assert "cut short" in picture.caption
    (dashed,) = [m for m in picture.marks if m.dashed]
    assert np.hypot(*(dashed.xy[0, 1] - dashed.xy[0, 0])) == pytest.approx(25.0)  # a quarter of 100 m


def test_corners_of_tilted_footprints_are_those_of_the_format_by_collinearity() -> None:
    """x = -c u1/u3, y = -c u2/u3 of the ground corners, R of the notes (phi about Y, then omega, kappa)."""
    block, (phi, omega, kappa) = made_block(), np.radians([8.0, -5.0, 30.0])
    c, s = np.cos, np.sin
    about_y = np.array([[c(phi), 0, -s(phi)], [0, 1, 0], [s(phi), 0, c(phi)]])
    about_x = np.array([[1, 0, 0], [0, c(omega), -s(omega)], [0, s(omega), c(omega)]])
    about_z = np.array([[c(kappa), -s(kappa), 0], [s(kappa), c(kappa), 0], [0, 0, 1]])
    solution = made_solution(block)
    R = np.tile(about_y @ about_x @ about_z, (len(block.images), 1, 1))
    solution = replace(solution, images=replace(solution.images, ground_from_image=R))
    feet = footprints(block, solution)
    ground = np.concatenate([feet, np.full((*feet.shape[:2], 1), 12.0)], axis=2)  # the terrain's mean height
    u = (ground - solution.images.position_m[:, None]) @ R[0]
    xy_mm = -150.0 * u[..., :2] / u[..., 2:]
    corners = 115.0 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    np.testing.assert_allclose(xy_mm, np.tile(corners, (len(feet), 1, 1)), atol=1e-9)


def test_every_point_is_drawn_once_in_its_role_at_its_place() -> None:
    block = made_block()
    solution = made_solution(block)
    picture = block_plan(block, solution)
    role = dict(zip(block.points.id[block.ground_points.point].tolist(), block.ground_points.role.max(axis=1).tolist()))
    xy = dict(zip(solution.points.id.tolist(), solution.points.xyz_m[:, :2].tolist()))
    drawn_ids = {
        name: [i for m in picture.marks if m.name == name for i in m.ids]
        for name in ("control", "check points", "new points")
    }
    assert sorted(drawn_ids["control"]) == sorted(i for i, r in role.items() if r == CONTROL)
    assert sorted(drawn_ids["check points"]) == sorted(i for i, r in role.items() if r == CHECK)
    assert sorted(drawn_ids["new points"]) == sorted(set(xy) - set(role))
    for mark in picture.marks:
        if mark.name in drawn_ids:
            np.testing.assert_allclose(mark.xy, [xy[i] for i in mark.ids], atol=1e-9)
