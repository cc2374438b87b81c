"""What `aatri compare` says of a run of which a stage failed, and of one that has nothing in common with the first."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from aatri.cli.compare import _parting_lines
from aatri.cli.main import app
from aatri.errors import ArtifactError
from aatri.pipeline.plan.compare import Compared, axes, changed_settings, option_rows, read_run
from tests.made_up_stages import made_up_registry, write_pipeline

STAGES = """  a: {use: source/fixed}
  s: {use: sum/add, from: {numbers: a}}
  l: {use: loop/report_size, from: {total: s, numbers: a}}
"""
RUNS = {
    "first": STAGES,
    "far": STAGES.replace("sum/add,", "sum/add, with: {offset: 2},"),
    "failed": STAGES.replace("sum/add", "sum/stubborn"),
    "absent": STAGES.replace("{use: source/fixed}", "{use: source/absent}"),
}


def _record(digest: str, plugin: str = "block/tables", **options: Any) -> dict[str, Any]:
    tables: dict[str, Any] = {name: {} for name in ("inputs", "files", "schemas")}
    parts = {"key_schema": 1, "plugin": plugin, "version": 1, "options": options, "code": "", "seed": None, **tables}
    made = {"output": {"content_digest": digest}, "environment": {}}
    return {"plugin": plugin, "options": options, "inputs": {}, "parts": parts, **made}


def _run(name: str, records: dict[str, Any], failures: dict[str, Any] | None = None) -> Compared:
    return Compared(name, Path(name), (*records, *(failures or {})), records, failures or {})


FIRST = _run("first", {"block": _record("a"), "bundle": _record("b", "bundle_adjustment/bundle", datum="given")})


def test_what_a_failed_run_has_changed_is_shown_and_why_it_failed() -> None:
    failure = {"plugin": "bundle_adjustment/bundle", "options": {"datum": "free"}, "what": "nothing is free"}
    free = _run("free", {"block": _record("a")}, {"bundle": failure})
    assert changed_settings(FIRST, free) == ["bundle.datum: given -> free"]
    assert [axis.stages for axis in axes([FIRST, free])] == [("bundle",)]
    assert option_rows([FIRST, free]) == [("bundle.datum", ["given", "free"])]
    assert _parting_lines([FIRST, free]) == ["free: bundle failed: nothing is free", "free: what both have is equal"]


def test_runs_that_have_no_stage_in_common_are_not_called_equal() -> None:
    (line,) = _parting_lines([FIRST, _run("two", {"west": _record("c")})])
    assert "nothing to compare" in line
    assert "equal" not in line


def test_of_another_method_its_own_options_are_not_listed() -> None:
    simulated = _run("simulated", {"block": _record("a", "block/simulate", preset="uav", name="uav")})
    read = _run("read", {"block": _record("a", name="")})
    assert [name for name, _ in option_rows([simulated, read])] == ["block.use", "block.name"]


def test_an_option_is_shown_that_differs_between_two_runs_of_one_method_beside_a_third_of_another() -> None:
    runs = [_run(f"{k}", {"bundle": _record("b", "bundle_adjustment/bundle", loss=k, iterations=9)}) for k in "xy"]
    other = _run("z", {"bundle": _record("c", "bundle_adjustment/exact")})
    assert option_rows([*runs, other])[1:] == [("bundle.loss", ["x", "y", None])]


def test_a_first_run_that_failed_is_not_called_equal() -> None:
    free = _run("free", {"block": _record("a")}, {"bundle": {"what": "nothing is free"}})
    lines = _parting_lines([free, FIRST])
    assert lines == ["free: bundle failed: nothing is free", "first: what both have is equal"]
    assert option_rows([free, FIRST]) == []  # the file of a failure need not say the options


@pytest.fixture
def compared(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., str]:
    """Runs some of `RUNS`, and what `aatri compare` prints of them."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("aatri.pipeline.methods.registry.find_stages", made_up_registry)

    def compare(*names: str) -> str:
        for name in names:
            path = write_pipeline(tmp_path, RUNS[name], f"run: {name}\nseed: 1\n")
            CliRunner().invoke(app, ["run", str(path)])
        return CliRunner().invoke(app, ["compare", *names]).output

    return compare


def test_a_failed_run_is_read_with_the_settings_of_what_failed(compared: Callable[..., str]) -> None:
    compared("failed")
    run = read_run(Path("failed"), "failed")
    assert (run.stages, [*run.records], [*run.failures]) == (("a", "s", "l"), ["a"], ["s"])
    assert (run.settings("s") or {})["plugin"] == "sum/stubborn"
    file = Path("failed", "failed", "s", "error.json")
    failure = json.loads(file.read_text())
    file.write_text(json.dumps({name: value for name, value in failure.items() if name not in ("plugin", "options")}))
    assert read_run(Path("failed"), "failed").settings("s") is None
    file.write_text(json.dumps(failure | {"options": 1}))
    with pytest.raises(ArtifactError, match="its 'options' is missing or wrong"):
        read_run(Path("failed"), "failed")


def test_three_runs_of_which_one_failed(compared: Callable[..., str]) -> None:
    text = compared("first", "far", "failed")
    assert "  far: s.offset: 0.0 -> 2.0\n  failed: s: sum/add -> sum/stubborn\n" in text
    assert text.endswith(
        "failed: s failed: no convergence after 3 iterations\nfailed: what both have is equal; it has no result of l\n"
    )


def test_the_failure_of_the_first_run_is_told_once(compared: Callable[..., str]) -> None:
    assert compared("failed", "first", "far").endswith(
        "\nfailed: s failed: no convergence after 3 iterations\n"
        "first: what both have is equal\nfar: what both have is equal\n"
    )


def test_of_a_run_that_failed_in_its_first_stage_the_method_is_shown(compared: Callable[..., str]) -> None:
    *_, head, row, _, failed, end = compared("first", "absent").splitlines()
    assert head.split() == ["option", "first", "absent"]
    assert row.split() == ["a.use", "source/fixed", "source/absent"]
    assert failed == "absent: a failed: nothing to read"
    assert end.endswith("nothing to compare")
