"""The key figures of two runs: first what counts, and what chance explains is said so."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.cli.compare import _figure
from aatri.cli.terminal.compare_tables import shown_value
from aatri.cli.terminal.key_figures import key_figures, pasted, say_key_figures
from aatri.pipeline.plan.compare import Compared, option_rows
from aatri.report.drawing.picture import Marks, Picture


def _run(name: str, check_m: float, sigma0: float, points: int = 50) -> Compared:
    metrics = {"check_points": points, **{f"check_rmse_{axis}_m": check_m for axis in "xyz"}}
    records = {
        "bundle": {"output": {"kind": "Solution"}, "seconds": 2.0, "metrics": {"sigma0": sigma0, "suspects": 3}},
        "accuracy": {"output": {"kind": "Evaluation"}, "seconds": 0.5, "metrics": metrics},
    }
    return Compared(name, Path(name), ("bundle", "accuracy"), records)


@pytest.mark.parametrize(
    ("other", "says"),
    [
        (0.0208, "within chance"),  # 1 / sqrt(2 * 50)
        (0.03, "+50.0%"),
        (0.02 * (1 + 1e-9), ""),
    ],
)
def test_a_difference_is_held_against_its_own_uncertainty(capsys, other: float, says: str) -> None:
    say_key_figures([_run("one", 0.02, 1.0), _run("two", other, 1.0)])
    lines = [line for line in capsys.readouterr().out.splitlines() if "check points, RMSE X mm" in line]
    assert len(lines) == 1
    assert lines[0].split("  ")[-1].strip() == (says or f"{1e3 * other:.0f}")


def test_few_points_tell_little(capsys) -> None:
    say_key_figures([_run("one", 0.02, 1.0, points=2), _run("two", 0.03, 1.2, points=2)])
    text = capsys.readouterr().out
    assert "within chance" in text
    assert "+20.0%" in text  # sigma0
    assert "seconds" in text


@pytest.mark.parametrize(("sigma0", "says"), [(1.0095, "within chance"), (1.012, "+1.2%")])
def test_sigma0_of_a_redundancy_of_5000_is_uncertain_by_a_hundredth(sigma0: float, says: str) -> None:
    one, two = _run("one", 0.02, 1.0), _run("two", 0.02, sigma0)
    for run in (one, two):
        run.records["bundle"]["metrics"]["redundancy"] = 5000  # 1 / sqrt(2 * 5000) is 0.01
    (row,) = [row for row in key_figures([one, two])[1] if row[0] == "bundle: sigma0"]
    assert row[-1] == says


def test_the_last_result_comes_before_those_on_the_way_to_it() -> None:
    first = _run("one", 0.02, 1.0)
    records = {"strips": first.records["accuracy"], **first.records}
    runs = [Compared(name, Path(name), ("strips", "bundle", "accuracy"), records) for name in ("one", "two")]
    stages = [row[0].partition(":")[0] for row in key_figures(runs)[1]]
    assert list(dict.fromkeys(stages)) == ["accuracy", "bundle", "seconds", "strips"]


def test_a_table_can_be_pasted() -> None:
    head, rows = key_figures([_run("one", 0.02, 1.0), _run("a|b", 0.03, 1.0)])
    lines = pasted(head, rows, "markdown").splitlines()
    assert lines[0] == "| key figures | one | a\\|b | difference |"
    assert lines[1] == "|---|---:|---:|---:|"
    assert lines[2] == "| accuracy: check points, RMSE X mm | 20 | 30 | +50.0% |"
    assert pasted(head, rows, "csv").splitlines()[1] == '"accuracy: check points, RMSE X mm",20,30,+50.0%'
    assert key_figures([_run(name, 0.02, 1.0) for name in "abc"])[0] == ["key figures", "a", "b", "c"]


@pytest.mark.parametrize(("other_m", "says"), [(0.02004, "within chance"), (0.0203, "+1.5%")])
def test_theory_is_as_uncertain_as_the_sigma0_that_scales_it(other_m: float, says: str) -> None:
    one, two = _run("one", 0.02, 1.0), _run("two", 0.02, 1.0)
    for run, theory_m in ((one, 0.02), (two, other_m)):
        run.records["bundle"]["metrics"]["redundancy"] = 5000  # 1 / sqrt(2 * 5000) is 0.01
        run.records["accuracy"]["inputs"] = {"solution": {"stage": "bundle"}}
        run.records["accuracy"]["metrics"]["theory_rmse_z_m"] = theory_m
    (row,) = [row for row in key_figures([one, two])[1] if "new points, theory" in row[0]]
    assert row[-1] == says


def test_options_that_come_with_another_are_told_with_it_in_one_line() -> None:
    """A set of parameters has options of its own, which the run without it does not have."""
    of_set = {"set": "brown", "sigma_um": 50.0, "orders": None}
    runs = []
    for name, calibration, tolerance in (("one", None, 1e-3), ("two", of_set, 1e-4)):
        record = {"plugin": "a/b", "options": {"calibration": calibration, "solver": {"tolerance": tolerance}}}
        runs.append(Compared(name, Path(name), ("bundle",), {"bundle": record}))
    rows = dict(option_rows(runs))
    assert rows == {
        "bundle.solver.tolerance": [1e-3, 1e-4],
        "bundle.calibration": [None, {"set": "brown", "sigma_um": 50.0}],
    }
    assert shown_value(rows["bundle.calibration"][1]) == "set brown, sigma_um 50"


def test_a_picture_and_its_caption_are_one_figure_of_the_page() -> None:
    marks = [Marks("dots", np.array([[0.0, 0.0], [1.0, 1.0]]), "blue", "points")]
    text = _figure(Picture("plan", "Plan", "Where they are.", marks))
    assert text.startswith("<figure>")
    assert text.endswith("<figcaption>Where they are.</figcaption></figure>")
