"""Networks in the report: ellipses, lines, points and observations with their tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.evaluation.accuracy import evaluate
from aatri.report.drawing.network import ellipses, network_picture, observed_lines
from aatri.report.facts import facts
from aatri.report.sections import network
from aatri.report.sections.network import shapes_table
from aatri.stages.block.tables import TablesOptions, tables
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.stages.bundle_adjustment.test_networks import HEAD


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
