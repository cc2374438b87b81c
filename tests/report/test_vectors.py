"""Vectors and bars of differences: direction, common scale and key; footprints and points in the plan."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.codes import CHECK, CONTROL
from aatri.evaluation.accuracy import evaluate
from aatri.report.drawing.network import ellipses, network_picture, observed_lines
from aatri.report.drawing.picture import Picture
from aatri.report.drawing.plan import block_plan, footprints
from aatri.report.drawing.vectors import height_bars, image_vectors, plan_vectors, tie_pictures
from aatri.report.facts import facts
from aatri.report.sections import network
from aatri.report.sections.network import shapes_table
from aatri.stages.block.tables import TablesOptions, tables
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.made_solutions import made_block, made_solution
from tests.stages.bundle_adjustment.test_networks import HEAD

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
    for rounding_m in (0.0, 1e-15):  # of exact control: the key was a vector of 2.0e-06 um
        picture = plan_vectors("x", {"control": (XYZ_M, np.full((4, 3), rounding_m), IDS)})
        assert all(np.isfinite(m.xy).all() for m in picture.marks)
        assert picture.key is None
        assert picture.caption.endswith("at 4 control points: all are zero.")


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


# Networks in the report: ellipses, lines, points and observations with their tests.


def test_ellipses_have_the_axes_and_the_bearing_they_were_made_of() -> None:
    bearing = np.radians([30.0, 120.0])
    C = np.zeros((3, 3, 3))
    for k, t in enumerate(bearing):
        u, w = np.array([np.sin(t), np.cos(t)]), np.array([np.cos(t), -np.sin(t)])
        C[k, :2, :2] = 0.09 * np.outer(u, u) + 0.01 * np.outer(w, w)
    C[2] = np.nan
    axes, found = ellipses(C)
    np.testing.assert_allclose(axes[:2], [[0.3, 0.1]] * 2, rtol=1e-12)
    np.testing.assert_allclose(found[:2], bearing, atol=1e-12)
    assert np.isnan(axes[2]).all()


@pytest.fixture
def adjusted(tmp_path: Path):
    return adjusted_network(tmp_path)


def adjusted_network(folder: Path):
    """Three control points and two others, measured by distances of which one is wrong."""
    rng = np.random.default_rng(3)
    places = {"A": (0, 0, 0), "B": (90, 10, 2), "C": (40, 80, 5), "P": (50, 30, 9), "Q": (20, 45, 3)}
    (folder / "block.yaml").write_text(HEAD)
    rows = [
        f"{k},{x},{y},{z}," + ("0,0,0,control" if k in "ABC" else ",,,approximate") for k, (x, y, z) in places.items()
    ]
    (folder / "ground_points.csv").write_text("\n".join(["point,X,Y,Z,sX,sY,sZ,role", *rows]) + "\n")
    lines = []
    for a in "ABCQ":
        for b in "PQ":
            if a != b:
                d = np.linalg.norm(np.subtract(places[a], places[b]))
                errors = rng.normal(0, 0.003, 2 if a + b != "AP" else 1)  # rows that are the same count once
                lines += [f"distance,{a},{b},{d + error},0.003" for error in errors.tolist()]
    wrong = np.linalg.norm(np.subtract(places["B"], places["P"])) + 0.5
    lines.append(f"distance,B,P,{wrong},0.003")
    (folder / "geodetic.csv").write_text("\n".join(["type,from,to,value,sigma", *lines]) + "\n")
    (folder / "relative_control.yaml").write_text("- {type: distance, points: [A, Q], value: 49.33, sigma: 0.5}\n")
    block = tables(options=TablesOptions(path=folder))
    return block, bundle(block, options=BundleOptions(reliability=True))


def test_lines_are_drawn_once_and_rejected_ones_as_such(adjusted) -> None:
    block, solution = adjusted
    rows, wrong = observed_lines(block, solution)
    names = ["".join(block.points.id[k] for k in row) for row in rows.tolist()]
    assert names == ["AP", "AQ", "BP", "BQ", "CP", "CQ", "PQ"]
    assert [n for n, w in zip(names, wrong) if w] == ["BP"]
    picture = network_picture(block, solution)
    assert "7 lines observed between 5 points" in picture.caption
    assert "1 with a rejected observation" in picture.caption
    drawn = {m.name: m for m in picture.marks}
    assert [len(drawn[name].xy) for name in ("observed", "with a rejected observation")] == [6, 1]
    assert list(drawn["with a rejected observation"].ids) == ["B to P"]
    assert list(drawn["standard ellipses"].ids) == ["P", "Q"]


def test_a_network_that_is_not_adjusted_is_drawn_and_its_observations_are_counted(adjusted) -> None:
    """A run that was refused or stopped before the adjustment; P and Q have approximate places."""
    block, _ = adjusted
    picture = network_picture(block, None)
    drawn = {m.name: len(m.xy) for m in picture.marks}
    assert drawn["observed"] == 7
    assert (drawn["control"], drawn["new points"]) == (3, 2)
    counted = facts(block, None)
    assert (counted["points"], counted["observed"]) == ("5", f"{len(block.geodetic)} distances")
    assert "images" not in counted


def test_control_of_a_network_takes_part_though_no_image_shows_it(adjusted) -> None:
    evaluation = evaluate(*adjusted)
    d = evaluation.differences
    assert sorted(d.point[d.kind == "control"].tolist()) == ["A", "B", "C"]
    assert "No control point" not in evaluation.verdict


def test_points_and_observations_are_listed_with_their_tests(adjusted) -> None:
    block, solution = adjusted
    points, observations = network.tables(block, solution)
    assert [row[0] for row in points.rows] == ["A", "B", "C", "P", "Q"]
    first = dict(zip(observations.heads, observations.rows[0]))
    assert (first["observation"], first["between"], first["used"]) == ("distance", "B-P", "rejected")
    second = dict(zip(observations.heads, observations.rows[1]))
    assert second["used"] == "yes"
    assert float(second["redundancy"]) > 0
    assert first["unit"] == "mm"
    assert float(first["sigma"]) == 3.0
    assert any(row[0] == "relative distance" for row in observations.rows)


def test_shapes_are_told_by_how_they_lie_and_by_their_residuals(tmp_path: Path) -> None:
    """A plane through three fixed points that dips by 30 degrees to the east; a fourth point is held to it."""
    slope = np.tan(np.radians(30.0))
    places = {"A": (0, 0, 0), "B": (90, 0, -90 * slope), "C": (40, 80, -40 * slope), "P": (50, 30, -50 * slope)}
    (tmp_path / "block.yaml").write_text(HEAD)
    rows = [
        f"{k},{x},{y},{z}," + ("0,0,0,control" if k in "ABC" else ",,,approximate") for k, (x, y, z) in places.items()
    ]
    (tmp_path / "ground_points.csv").write_text("\n".join(["point,X,Y,Z,sX,sY,sZ,role", *rows]) + "\n")
    lines = [f"distance,{a},P,{np.linalg.norm(np.subtract(places[a], places['P']))},0.003" for a in "ABC"]
    (tmp_path / "geodetic.csv").write_text("\n".join(["type,from,to,value,sigma", *lines]) + "\n")
    (tmp_path / "relative_control.yaml").write_text(
        "- {type: plane, points: [A, B, C, P], sigma: 0.001}\n- {type: horizontal_line, points: [A, P], sigma: 100.0}\n"
    )
    block = tables(options=TablesOptions(path=tmp_path))
    made = shapes_table(block, bundle(block, options=BundleOptions(blunders="none")))
    assert made is not None
    second, first = (dict(zip(made.heads, row)) for row in made.rows)
    assert first["shape"] == "plane"
    assert first["normal or axis"] == "bearing 90.000, slope 60.000 deg"
    assert (first["sigma"], first["used"], first["rejected"]) == ("1.00 mm", "4", "0")
    assert second["points"] == "A, P"
    bearing, dip = np.degrees(np.arctan2(-50, -30)) % 360, np.degrees(np.arctan(50 * slope / np.hypot(50, 30)))
    assert second["normal or axis"] == f"bearing {bearing:.3f}, slope {dip:.3f} deg"
