"""`aatri show FILE.h5 TABLE`: values, units, how many were left off."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from aatri.artifacts.solution import Parameters, ProposedNumbers
from aatri.cli.main import app
from aatri.formats.results.solution_tables import write_solution_tables
from aatri.tables.hdf5 import write
from tests.made_solutions import made_block, made_solution


def _show(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["show", *arguments])


@pytest.fixture
def solution(tmp_path: Path) -> str:
    write(made_solution(made_block()), tmp_path / "s.h5")
    return str(tmp_path / "s.h5")


def test_values_are_printed_with_units_and_a_count_of_the_rest(solution: str) -> None:
    shown = _show(solution, "points")
    assert shown.exit_code == 0, shown.stderr
    lines = shown.stdout.splitlines()
    assert lines[0].split()[:3] == ["point", "X_m", "[m]"]
    assert lines[1].startswith("p00 ")
    assert "-" not in lines[0]
    many = _show(solution, "points", "--all")
    assert len(many.stdout.splitlines()) == 21
    assert "more rows" not in many.stderr


def test_numbers_are_printed_to_two_digits_of_their_standard_deviations_and_read_in_full(tmp_path: Path) -> None:
    made = made_solution(made_block())
    xyz_m = np.full_like(made.points.xyz_m, 443303.4719569073)
    covariance_m2 = np.zeros_like(made.points.covariance_m2)
    covariance_m2[:, [0, 1, 2], [0, 1, 2]] = [0.031**2, 1.5e-7**2, 0.0]
    points = replace(made.points, xyz_m=xyz_m, covariance_m2=covariance_m2)
    write(replace(made, points=points), tmp_path / "s.h5")
    row = _show(str(tmp_path / "s.h5"), "points").stdout.splitlines()[1].split()
    assert row[1:7] == ["443303.472", "443303.47195691", "443303.4720", "0.031", "1.5e-07", "0"]
    full = json.loads(_show(str(tmp_path / "s.h5"), "points", "--json").stdout)["rows"][0]
    assert full["X_m"] == 443303.4719569073


def test_attributes_have_their_digits(tmp_path: Path) -> None:
    write(replace(made_solution(made_block()), sigma0_um=443303.4719), tmp_path / "s.h5")
    lines = [line.split() for line in _show(str(tmp_path / "s.h5")).stdout.splitlines()]
    assert ["sigma0_um", "443303.4719"] in lines


def test_cameras_have_the_standard_deviations_that_exported_tables_have(tmp_path: Path) -> None:
    block = made_block()
    camera = str(block.cameras.id[0])
    parameters = Parameters(["camera"], [camera], ["principal_distance"], np.array([153.0]), np.array([0.0123]))
    made = replace(made_solution(block), parameters=parameters)
    write(made, tmp_path / "s.h5")
    write_solution_tables(made, block, tmp_path)
    with (tmp_path / "cameras.csv").open() as file:
        exported = next(csv.DictReader(file))
    shown = json.loads(_show(str(tmp_path / "s.h5"), "cameras", "--json").stdout)["rows"][0]
    assert set(shown) <= set(exported)
    assert shown["sprincipal_distance_mm"] == float(exported["sprincipal_distance_mm"]) == pytest.approx(0.0123)


def test_json_has_rows_by_name_units_and_what_was_left_off(solution: str) -> None:
    told = json.loads(_show(solution, "points", "--json").stdout)
    assert told["table"] == "points"
    assert told["units"]["X_m"] == "m"
    assert told["rows"][0]["point"] == "p00"
    assert told["left_off"] == 0


def test_an_unknown_table_names_the_near_one(solution: str) -> None:
    wrong = _show(solution, "point")
    assert wrong.exit_code == 2
    assert "did you mean 'points'" in wrong.stderr


def test_a_search_that_proposes_no_numbers_is_told_from_none_at_all(solution: str, tmp_path: Path) -> None:
    none = _show(solution, "proposed_numbers")
    assert none.exit_code == 2
    assert "only a search for gross errors proposes numbers" in none.stderr
    searched = replace(made_solution(made_block()), proposed_numbers=ProposedNumbers.empty())
    write(searched, tmp_path / "searched.h5")
    shown = _show(str(tmp_path / "searched.h5"), "proposed_numbers")
    assert shown.exit_code == 0
    assert "none are proposed" in shown.stderr
