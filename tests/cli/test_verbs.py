from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from aatri import __version__
from aatri.cli.main import app
from aatri.strict_yaml import load
from aatri.tables.hdf5 import read_warnings
from tests.made_up_stages import made_up_registry, write_pipeline

LINES = "  a: {use: source/fixed}\n  s: {use: sum/add, from: {numbers: a}}\n"


@pytest.fixture(autouse=True)
def _made_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("aatri.pipeline.methods.registry.find_stages", made_up_registry)


def aatri(*arguments: str) -> Result:
    return CliRunner().invoke(app, list(arguments))


@pytest.fixture
def project(tmp_path: Path) -> Path:
    write_pipeline(tmp_path, LINES)
    assert aatri("run").exit_code == 0
    return tmp_path


def test_help_and_version_import_nothing_heavy() -> None:
    code = (
        "import sys; from aatri.cli.main import app; from typer.testing import CliRunner;"
        "r = CliRunner().invoke(app, ['--help']); assert r.exit_code == 0;"
        "print([m for m in ('numpy', 'scipy', 'h5py', 'pydantic', 'yaml') if m in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
    assert aatri("--version").stdout == f"aatri {__version__}\n"


def test_run_without_a_file_says_what_to_do() -> None:
    result = aatri("run")
    assert result.exit_code == 2
    assert "aatri new" in result.stderr


def test_run_ends_with_a_table_and_tells_where_things_lie(tmp_path: Path) -> None:
    write_pipeline(tmp_path, LINES)
    result = aatri("run", "--set", "a.count=4", "--into", "elsewhere")
    assert result.exit_code == 0, result.stderr
    assert "[2/2] s" in result.stderr
    assert "sum/add" in result.stdout
    assert "run     elsewhere" in result.stdout
    assert (tmp_path / "elsewhere" / "current" / "s.h5").exists()
    assert aatri("run", "-q").stderr.count("[") == 0


@pytest.mark.slow(after=1)
@pytest.mark.parametrize(
    ("line", "code", "message"),
    [
        ("  s: {use: sum/add, from: {numbres: a}}\n", 2, "error: pipeline.yaml:5:28: sum has no port 'numbres'"),
        ("  s: {use: sum/nothing, from: {numbers: a}}\n", 9, "no stage 'sum/nothing'"),
        ("  s: {use: sum/stubborn, from: {numbers: a}}\n", 5, "error: point 12: no convergence after 3 iterations"),
        ("  s: {use: sum/buggy, from: {numbers: a}}\n", 1, "internal error in s (a bug)"),
        ("  s: {use: sum/liar, from: {numbers: a}}\n", 9, "returned a Numbers"),
        ("  s: {use: sum/interrupted, from: {numbers: a}}\n", 130, "interrupted"),
    ],
)
def test_errors_have_their_exit_codes_and_no_traceback(tmp_path: Path, line: str, code: int, message: str) -> None:
    write_pipeline(tmp_path, f"  a: {{use: source/fixed}}\n{line}")
    result = aatri("run")
    assert result.exit_code == code
    assert message in result.stderr
    assert "Traceback" not in result.stderr
    if code != 130:
        assert "Traceback" in aatri("run", "--debug").stderr


def test_a_broken_report_does_not_hide_the_result(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "aatri.report.page", None)
    result = aatri("run", "--force", "s")
    assert result.exit_code == 0
    assert "warning: no report" in result.stderr
    assert "sum/add" in result.stdout


@pytest.mark.parametrize(("variant", "code"), [("add", 0), ("stubborn", 5)])
def test_the_report_of_a_run_is_named_and_opened_also_where_it_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, variant: str, code: int
) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", lambda address: opened.append(address) is None)
    write_pipeline(tmp_path, LINES)
    result = aatri("run", "--open", "--use", f"s=sum/{variant}")
    assert result.exit_code == code
    assert "report  out/report.html" in result.output
    assert opened == [(tmp_path / "out" / "report.html").as_uri()]


def test_control_characters_do_not_reach_the_terminal(project: Path) -> None:
    result = aatri("run", "--set", "a.count=7")
    assert "\x1b" not in result.output
    assert "warning: a: seven is \\x1b[31mmany" in result.stderr


@pytest.mark.slow
def test_a_warning_is_on_the_terminal_in_the_artifact_in_the_record_and_in_the_report(project: Path) -> None:
    result = aatri("run", "-q", "--set", "a.count=7")
    assert "warning: a: seven is" in result.stderr
    run = next(project.rglob("current")).parent
    artifact = run / "current" / "a.h5"
    assert read_warnings(artifact) == ("seven is \x1b[31mmany",)
    assert json.loads(artifact.resolve().with_name("record.json").read_text())["warnings"] == ["seven is \x1b[31mmany"]
    assert "Seven is" in (run / "report.html").read_text()  # as a sentence
    copied = project / "copied.h5"
    copied.write_bytes(artifact.read_bytes())
    assert "warning  seven is" in aatri("show", str(copied)).stdout


def test_status_tells_done_failed_and_not_run(tmp_path: Path) -> None:
    write_pipeline(tmp_path, LINES)
    states = {s["stage"]: s["state"] for s in json.loads(aatri("status", "--json").stdout)["stages"]}
    assert states == {"a": "not run", "s": "not run"}
    assert aatri("run", "--use", "s=sum/stubborn").exit_code == 5
    told = json.loads(aatri("status", "out", "--json").stdout)
    assert told["status"] == "failed"
    assert {s["stage"]: s["state"] for s in told["stages"]} == {"a": "done", "s": "failed"}
    assert "no convergence" in aatri("status", "out").stdout
    assert aatri("run").exit_code == 0
    (tmp_path / "out" / "current" / "s.h5").resolve().write_bytes(b"short")
    assert "altered" in aatri("status").stdout


def test_metrics_give_every_figure_with_the_seconds(project: Path) -> None:
    values = json.loads(aatri("metrics", "--json").stdout)
    assert values["s"]["total"] == 6.0
    assert values["a"]["sigma0"] is None
    assert set(values["s"]) == {"total", "sigma0", "seconds"}
    assert json.loads(aatri("metrics", "out", "--json").stdout) == values
    assert "total" in aatri("metrics", "pipeline.yaml").stdout


def test_show_tells_content_and_provenance(project: Path) -> None:
    text = aatri("show", "out:a").stdout
    for part in ("Numbers", "values: 3 rows. Numbers.", "a number", "source/fixed version 1", "count = 3", "SHA-256"):
        assert part in text
    assert aatri("show", ":a").stdout == text
    shown = json.loads(aatri("show", "out/current/s.h5", "--json").stdout)
    assert shown["kind"] == "Total"
    assert shown["record"]["inputs"]["numbers"]["stage"] == "a"
    assert aatri("show", "out:x").exit_code == 2
    assert aatri("show", "out").exit_code == 2
    assert "one of out:a, out:s" in aatri("show", "out").stderr
    assert "aatri show :a" in aatri("show", "a").stderr
    assert aatri("show", "none.h5").exit_code == 7
    Path("alien.h5").write_bytes(b"no HDF5")
    assert aatri("show", "alien.h5").exit_code == 7


def test_stages_lists_roles_and_describes_variants() -> None:
    listed = json.loads(aatri("stages", "--json").stdout)
    assert listed["sum"]["ports"] == {"numbers": "Numbers", "more": "Numbers"}
    text = aatri("stages", "source/fixed").stdout
    for part in ("integer >= 1 <= 9", "how many numbers", "up, down", "inner.depth", "returns  Numbers"):
        assert part in text
    assert (
        json.loads(aatri("stages", "source/fixed", "--json").stdout)["options"]["properties"]["count"]["default"] == 3
    )
    assert aatri("stages", "source").stdout.startswith("source: nothing -> Numbers")
    assert aatri("stages", "sauce").exit_code == 9


@pytest.mark.parametrize("block", ["simulate", "tables", "wucaps", "dbat", "bal", "colmap"])
def test_new_writes_a_pipeline_once(tmp_path: Path, block: str) -> None:
    assert aatri("new", "p", "--block", block).exit_code == 0
    stages = load(tmp_path / "p" / "pipeline.yaml").value["stages"]
    assert stages["block"]["use"] == f"block/{block}"
    assert list(stages)[-1] == "accuracy"
    again = aatri("new", "p")
    assert again.exit_code == 2
    assert "is there already" in again.stderr


def test_export_wants_a_solution_or_a_block_and_an_empty_folder(project: Path) -> None:
    assert "no stage with a Solution" in aatri("export", "out", "tables", "dir").stderr
    assert "gives Total" in aatri("export", "out:s", "tables", "dir").stderr
    full = aatri("export", "out:s", "tables", ".")
    assert full.exit_code == 2
    assert "--overwrite" in full.stderr
    assert aatri("export", "out:s", "pictures", "dir").exit_code == 2


def test_verbs_say_when_there_is_no_run(tmp_path: Path) -> None:
    for verb in ("status", "metrics", "report"):
        assert aatri(verb).exit_code == 2
        assert aatri(verb, "nowhere").exit_code == 2
    assert aatri("status", str(tmp_path)).exit_code == 7
    write_pipeline(tmp_path, LINES)
    assert aatri("report").exit_code == 7


def test_figures_of_a_run_never_made_are_an_error(tmp_path: Path) -> None:
    write_pipeline(tmp_path, LINES)
    result = aatri("metrics")
    assert result.exit_code == 7
    assert "has not been run" in result.stderr


@pytest.mark.parametrize("arguments", [["export", "run", "tabels", "out"], ["new", "--block", "tabels"]])
def test_a_misspelt_form_or_source_is_told_the_near_one(arguments: list[str]) -> None:
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 2
    assert "did you mean 'tables'?" in " ".join(done.stderr.split())
