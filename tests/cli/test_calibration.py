"""The terminal tells what was estimated of the cameras."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.solution import ParameterCovariances, Parameters
from aatri.cli.run_ending import say_parameters
from aatri.formats.results.column_names import parameter_units
from aatri.observations.relative.lines import HORIZONTAL, LINE, PLUMB
from aatri.observations.relative.planes import PLANE_SHAPE, VERTICAL
from aatri.observations.relative.round_shapes import CYLINDER, SPHERE
from aatri.report.sections.calibration import parameter_summary
from aatri.tables.hdf5 import read, write
from tests.formats.results.test_readable import full_solution


def test_values_sigmas_and_units_are_printed_and_film_is_not(capsys: pytest.CaptureFixture[str]) -> None:
    say_parameters(parameter_summary("bundle", full_solution()))
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["cam", "k1", "3.00e-08", "2.0e-09", "mm^-2"] in lines
    assert ["cam", "k2", "removed", "mm^-4"] in lines
    assert not any("film" in line for line in lines)


def test_parameters_of_single_images_are_counted(capsys: pytest.CaptureFixture[str]) -> None:
    solution = full_solution()
    groups, names = ["film", "velocity", "rolling shutter", "additional"], ["d0", "vx", "readout", "p1"]
    of_images = replace(solution.parameters, group=groups, name=names, sigma=[1e-3, 0.1, 0.01, 1e-6])
    of_images = replace(solution, parameters=of_images, parameter_covariances=None)
    say_parameters(parameter_summary("bundle", of_images))
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[1] for line in lines if line.startswith("cam ")] == ["readout", "p1"]
    assert lines[-1] == "2 of single images: aatri show RUN:bundle parameters --all"
    assert parameter_units(of_images)[1] == "m/s"


def test_parameters_of_a_camera_have_the_units_of_its_model(capsys: pytest.CaptureFixture[str]) -> None:
    """`brown` is a polynomial in mm, `opencv` one in normalised coordinates; c of a set is a change of that given."""
    solution = full_solution()
    metric, forward = ("principal_distance", "as", "k1", "k3", "p1"), ("principal_distance", "q", "k1", "k6", "p1")
    parameters = replace(
        solution.parameters,
        group=["camera"] * 10 + ["additional"],
        object=["metric"] * 5 + ["forward"] * 5 + ["metric"],
        name=[*metric, *forward, "c"],
        value=[0.5] * 11,
        sigma=[0.1] * 11,
    )
    solution = replace(solution, parameters=parameters, parameter_covariances=None)
    units = ["mm", "1", "mm^-2", "mm^-6", "mm^-1", "mm", "1", *["1 (normalised)"] * 3]
    assert parameter_units(solution)[:10] == units
    say_parameters(parameter_summary("bundle", solution))
    assert "metric c (change)" in capsys.readouterr().out


def test_unknowns_of_conditions_and_of_distances_have_units() -> None:
    shapes = (LINE, PLUMB, HORIZONTAL, PLANE_SHAPE, VERTICAL, SPHERE, CYLINDER)
    names = [*(name for shape in shapes for name in shape.labels), "scale", "addition", "readout"]
    n, solution = len(names), full_solution()
    of_shapes = replace(
        solution.parameters, group=["x"] * n, object=["a"] * n, name=names, value=[0.1] * n, sigma=[0.1] * n
    )
    assert all(parameter_units(replace(solution, parameters=of_shapes, parameter_covariances=None)))


def test_strong_correlations_are_named(capsys: pytest.CaptureFixture[str]) -> None:
    solution = full_solution()
    c = solution.parameter_covariances
    assert c is not None
    strong = c.covariance.copy()
    strong[2] = -1.94e-15  # of sigmas 2e-9 and 1e-6
    say_parameters(parameter_summary("bundle", replace(solution, parameter_covariances=replace(c, covariance=strong))))
    assert "cam: k1 and p1 correlate by -0.970" in capsys.readouterr().out


def test_the_same_two_parameters_of_many_cameras_are_one_line() -> None:
    n = 12
    name, of = np.tile(["k1", "k2"], n), np.repeat([f"c{k}" for k in range(n)], 2)
    parameters = Parameters(group=["camera"] * 2 * n, object=of, name=name, value=[0.1] * 2 * n, sigma=[1.0] * 2 * n)
    first = np.arange(0, 2 * n, 2)
    variances = np.arange(2 * n)
    pairs = ParameterCovariances(
        first=[*variances, *first], second=[*variances, *first + 1], covariance=[1.0] * 2 * n + [-0.97, *[-0.95] * 11]
    )
    solution = replace(full_solution(), parameters=parameters, parameter_covariances=pairs)
    (line,) = parameter_summary("bundle", solution)["correlations"]
    assert line == "c0: k1 and k2 correlate by -0.970, and in 11 further pairs by 0.9 or more"


def test_of_a_solution_the_tables_that_are_shown_are_read_alone(tmp_path: Path) -> None:
    whole = full_solution()
    write(whole, tmp_path / "a.h5")
    part = read(tmp_path / "a.h5", type(whole), ("parameters", "parameter_covariances"))
    assert part.parameters.name.tolist() == whole.parameters.name.tolist()
    assert part.parameter_covariances is not None
    assert len(part.residuals) == 0
    assert part.tests is None
