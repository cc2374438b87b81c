"""Tables for readers: ids, units, the worst first, a count of what was left off; and the files of an export."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.kinds import KINDS
from aatri.artifacts.residuals import Residuals
from aatri.artifacts.residuals import Tests as Reliability
from aatri.artifacts.solution import CalibratedSets, ParameterCovariances, Parameters
from aatri.artifacts.suspects import Suspects
from aatri.errors import SpecError
from aatri.formats.results.readable import as_records, readable
from aatri.formats.results.solution_tables import write_solution_tables
from tests.made_solutions import made_block, made_solution
from tests.stages.chain import simulated


def full_solution():
    nan = np.nan
    residuals = Residuals(
        kind=["image_point", "image_point", "control"],
        row=[0, 1, 0],
        image=["1-0", "1-1", ""],
        point=["p00", "p10", "p00"],
        residual=[[0.001, 0.002, nan], [0.03, 0.0, nan], [0.01, 0.0, 0.02]],
        sigma=[[0.005, 0.005, nan], [0.005, 0.005, nan], [0.02, 0.02, 0.0]],
        active=[True, False, True],
        unit=["mm", "mm", "m"],
    )
    tests = Reliability(
        redundancy=[[0.6, 0.7, nan], [0.5, 0.5, nan], [0.3, 0.3, nan]],
        test=[[0.26, -0.48, nan], [8.5, 0.0, nan], [-0.9, 0.0, nan]],
        detectable=[[0.027, 0.025, nan], [0.029, 0.029, nan], [0.15, 0.15, nan]],
        external=[[3.4, 2.7, nan], [4.1, 4.1, nan], [6.3, 6.3, nan]],
        point_moved_m=np.full((3, 3), 0.01),
        image_moved_m=np.full((3, 3), 0.02),
        image_turned_rad=np.full((3, 3), 1e-5),
    )
    suspects = Suspects(
        kind=["control", "image_point"],
        row=[0, 1],
        image=["", "1-1"],
        point=["p00", "p10"],
        stage=["absolute_orientation", "bundle_adjustment"],
        size=[0.1, 0.06],
        unit=["m", "mm"],
        sigma=[0.025, 0.007],
        test=[4.0, -8.5],
        verdict=["rejected", "rejected"],
    )
    parameters = Parameters(
        group=["film", "additional", "additional", "additional"],
        object=["1-0", "cam", "cam", "cam"],
        name=["film correction d0", "k1", "k2", "p1"],
        value=[1e-4, 3e-8, 0.0, 2e-6],
        sigma=[1e-3, 2e-9, 0.0, 1e-6],
    )
    covariances = ParameterCovariances(
        first=[1, 1, 1, 2, 2, 3], second=[1, 2, 3, 2, 3, 3], covariance=[4e-18, 0.0, -1e-15, 0.0, 0.0, 1e-12]
    )
    sets = CalibratedSets(
        object=["cam"],
        camera=["cam"],
        per=["camera"],
        set=["brown_conrady"],
        interior=[False],
        parameters=[3],
        principal_distance_mm=[150.0],
        principal_point_mm=[[0.0, 0.0]],
        half_format_mm=[[115.0, 115.0]],
        base_mm=[90.0],
    )
    return replace(
        made_solution(made_block()),
        residuals=residuals,
        tests=tests,
        suspects=suspects,
        parameters=parameters,
        parameter_covariances=covariances,
        calibrated_sets=sets,
    )


def test_the_worst_comes_first_by_id_and_with_its_unit() -> None:
    solution = full_solution()
    assert [r["image"] for r in as_records(readable(solution, "suspects"))] == ["1-1", ""]
    assert "row" not in readable(solution, "suspects").head
    residuals = as_records(readable(solution, "residuals"))
    assert [(r["kind"], r["image"], r["unit"]) for r in residuals] == [
        ("image_point", "1-1", "mm"),
        ("control", "", "m"),
        ("image_point", "1-0", "mm"),
    ]
    tests = as_records(readable(solution, "tests"))
    assert [(t["point"], t["wx"], t["detectable_x"]) for t in tests] == [
        ("p10", 8.5, 0.029),
        ("p00", -0.9, 0.15),
        ("p00", 0.26, 0.027),
    ]
    assert tests[0]["redundancy_x"] == 0.5


def test_parameters_of_cameras_come_before_film_and_have_units() -> None:
    rows = as_records(readable(full_solution(), "parameters"))
    assert [(r["name"], r["unit"]) for r in rows] == [
        ("k1", "mm^-2"),
        ("k2", "mm^-4"),
        ("p1", "mm^-1"),
        ("film correction d0", "mm"),
    ]


def test_what_is_left_off_is_counted() -> None:
    found = readable(full_solution(), "residuals", most=1)
    assert (len(found.rows()), found.left_off) == (1, 2)


def test_rows_of_other_tables_are_shown_by_id_and_rotations_as_angles() -> None:
    block = made_block()
    points = as_records(readable(block, "image_points", most=2))
    assert points[0]["image"] in block.images.id.tolist()
    assert points[0]["point"] in block.points.id.tolist()
    image = as_records(readable(made_solution(block), "images", most=1))[0]
    assert image["omega_deg"] == image["phi_deg"] == image["kappa_deg"] == 0.0
    assert image["image"] == "1-0"


def test_codes_of_the_exterior_are_shown_as_the_words_of_its_file() -> None:
    block, one = simulated(1, preset="uav", flight={"strips": 1, "images_per_strip": 2}), np.array([0, 1])
    exterior = replace(block.exterior.take(one), position_use=one, angle_use=1 - one, refers_to=1 - one)
    rows = as_records(readable(replace(block, exterior=exterior), "exterior"))
    shown = [(r["position_use"], r["angle_use"], r["refers_to"]) for r in rows]
    assert shown == [("approximate", "observed", "antenna"), ("observed", "approximate", "projection_centre")]


def test_an_unknown_table_and_one_without_values_say_what_there_is() -> None:
    with pytest.raises(SpecError, match=r"did you mean 'suspects'"):
        readable(full_solution(), "suspect")
    with pytest.raises(SpecError, match=r"reliability: true"):
        readable(replace(full_solution(), tests=None), "tests")


def test_every_kind_of_artifact_is_known_by_name() -> None:
    assert list(KINDS) == ["Block", "ImagePoints", "Models", "Strips", "Solution", "Evaluation", "Information"]


def _read(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_an_export_has_suspects_tests_correlations_and_empty_cells_for_what_was_removed(tmp_path: Path) -> None:
    block = made_block()
    block = replace(
        block, frames=replace(block.frames, crs=["EPSG:32650"], vertical=["EPSG:5773"], axes=["north,east,up"])
    )
    write_solution_tables(full_solution(), block, tmp_path)
    suspects = _read(tmp_path / "suspects.csv")
    assert [(r["kind"], r["image"], r["w"], r["size"], r["unit"], r["verdict"]) for r in suspects] == [
        ("control", "", "4.0", "0.1", "m", "rejected"),
        ("image_point", "1-1", "-8.5", "0.06", "mm", "rejected"),
    ]
    tests = _read(tmp_path / "tests.csv")
    assert (tests[1]["wx"], tests[1]["redundancy_x"], tests[1]["detectable_x"], tests[1]["active"]) == (
        "8.5",
        "0.5",
        "0.029",
        "no",
    )
    assert tests[1]["wz"] == ""
    assert [r["active"] for r in _read(tmp_path / "residuals.csv")] == ["yes", "no", "yes"]
    parameters = {r["name"]: r for r in _read(tmp_path / "parameters.csv")}
    assert (parameters["k2"]["value"], parameters["k2"]["sigma"], parameters["k2"]["unit"]) == ("", "", "mm^-4")
    correlations = {(r["name_1"], r["name_2"]): r["correlation"] for r in _read(tmp_path / "parameter_covariances.csv")}
    assert float(correlations["k1", "p1"]) == pytest.approx(-0.5)
    assert float(correlations["k1", "k1"]) == pytest.approx(1.0)
    assert not any("k2" in pair for pair in correlations)
    assert _read(tmp_path / "frame.csv") == [
        {"frame": "map", "axes": "east,north,up", "crs": "EPSG:32650", "vertical": "EPSG:5773"}
    ]


def test_a_column_has_one_name_in_show_and_in_files(tmp_path: Path) -> None:
    solution = full_solution()
    write_solution_tables(solution, made_block(), tmp_path)
    tables = {"images": "exterior", "points": "points", "residuals": "residuals", "tests": "tests"}
    tables |= {"suspects": "suspects", "parameters": "parameters"}
    only_shown = {"images": {"oriented"}}
    for table, name in tables.items():
        with (tmp_path / f"{name}.csv").open(encoding="utf-8") as file:
            written = set(next(csv.reader(file)))
        assert set(readable(solution, table).head) - only_shown.get(table, set()) <= written, table
