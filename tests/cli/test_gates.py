"""Quality gates as the command line, the report and Python tell them; the sum of 1, 2, 3 is 6."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

import aatri as package
from aatri.cli.main import app
from aatri.errors import GateError
from tests.made_up_stages import made_up_registry, write_pipeline

LINES = "  a: {use: source/fixed}\n  s: {use: sum/add, from: {numbers: a}}\n"


@pytest.fixture(autouse=True)
def _made_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("aatri.pipeline.methods.registry.find_stages", made_up_registry)


def project(gates: str, more: str = "") -> None:
    write_pipeline(Path(), LINES, f"run: out\nseed: 1\ngates: {gates}\n{more}")


def aatri(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


@pytest.mark.slow
def test_a_gate_that_fails_is_told_a_line_each_and_ends_with_6() -> None:
    project("{s: {total: {max: 5}, sigma0: {max: 2}}, a: {sigma0: {max: 2}}}")
    for _ in range(2):  # also where nothing is to be done
        done = aatri("run", "-q")
        assert done.exit_code == 6
        assert done.stderr.splitlines() == [
            "error: 2 quality gates failed; the results are written",
            "    pipeline.yaml:3:20: s.total: 6, wanted at most 5",
            "    pipeline.yaml:3:61: a.sigma0: no value, wanted at most 2",
        ]
        assert "gates   1 of 3 passed" in done.stdout
    assert "nothing to do" in aatri("run").stderr
    assert "to go on" not in aatri("run", "--force", "all").stderr
    report = Path("out/report.html").read_text()
    assert "<caption>Gates</caption>" in report
    assert '<td>at most 5</td><td class="id">failed</td>' in report
    assert ">gate failed ·" in report


def test_json_and_status_carry_the_gates() -> None:
    project("{s: {total: {min: 1, max: 5}}}")
    done = aatri("run", "--json")
    assert done.exit_code == 6
    expected = [{"stage": "s", "metric": "total", "min": 1, "max": 5, "value": 6.0, "passed": False}]
    assert json.loads(done.stdout)["gates"] == expected
    assert [stage["stage"] for stage in json.loads(done.stdout)["stages"]] == ["a", "s"]
    told = json.loads(aatri("status", "--json").stdout)
    assert (told["status"], told["gates"]) == ("gate_failed", expected)
    text = aatri("status", "out").stdout
    assert "run out: gate_failed" in text
    assert "gate failed: s.total: 6, wanted from 1 to 5" in text
    assert {stage["state"] for stage in told["stages"]} == {"done"}


@pytest.mark.slow
def test_gates_that_pass_end_with_0() -> None:
    project("{s: {total: {max: 6}}}")
    done = aatri("run")
    assert done.exit_code == 0, done.stderr
    assert "gates   1 of 1 passed" in done.stdout
    assert "gate failed" not in aatri("status").stdout
    assert aatri("run", "--set", "gates.s.total.max=5").exit_code == 6
    assert aatri("run", "out").exit_code == 6  # the run of the folder as it was asked for last
    assert aatri("run", "--until", "a", "--set", "gates.s.total.max=5").exit_code == 0


def test_a_misspelt_metric_ends_with_2() -> None:
    project("{s: {totl: {max: 6}}}")
    done = aatri("run", "-q")
    assert done.exit_code == 2
    assert "pipeline.yaml:3:19: gate: s has no metric 'totl' - did you mean 'total'?" in done.stderr
    assert aatri("run", "-q", "--until", "a").exit_code == 0


@pytest.mark.slow
def test_every_variant_is_judged_and_compared_and_reads_nothing_that_another_has_made(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    project(
        "{s: {total: {max: 6}}}", "variants: {far: {s: {with: {offset: 9.0}}}, near: {s: {with: {offset: -1.0}}}}\n"
    )
    with monkeypatch.context() as without:
        without.delattr("aatri.tables.hdf5.read")
        done = aatri("run", "--all-variants", "-q")
    assert done.exit_code == 6
    assert "pipeline.yaml:3:20: s.total: 15, wanted at most 6" in done.stderr
    assert "s.total: 5," not in done.stderr
    assert "far failed: a quality gate failed" in done.stdout
    assert "near failed" not in done.stdout
    compared = done.stdout.partition("far failed")[0].rpartition("report ")[2]
    assert all(text in compared for text in ("far", "near", "15", "9.0"))
    assert aatri("run", "--all-variants", "-q", "--set", "gates.s.total.max=5").exit_code == 6
    assert json.loads(aatri("status", "out", "--json").stdout)["status"] == "gate_failed"
    assert json.loads(aatri("status", "out/variants/near", "--json").stdout)["status"] == "done"


def test_python_gets_a_gate_error_after_the_results_are_written() -> None:
    project("{s: {total: {max: 5}}}")
    with pytest.raises(GateError, match=r"s\.total: 6, wanted at most 5"):
        package.run("pipeline.yaml")
    assert package.open("out")["s"].metrics["total"] == 6
    assert Path("out/report.html").is_file()
