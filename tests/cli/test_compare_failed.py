"""What `aatri compare` says of a run of which a stage failed, and of one that has nothing in common with the first."""

from pathlib import Path
from typing import Any

from aatri.cli.compare import _parting_lines
from aatri.pipeline.plan.compare import Compared, axes, changed_settings, option_rows


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
    assert _parting_lines(FIRST, free) == ["free: bundle failed: nothing is free", "free: what both have is equal"]


def test_runs_that_have_no_stage_in_common_are_not_called_equal() -> None:
    (line,) = _parting_lines(FIRST, _run("two", {"west": _record("c")}))
    assert "nothing to compare" in line
    assert "equal" not in line


def test_of_another_method_its_own_options_are_not_listed() -> None:
    simulated = _run("simulated", {"block": _record("a", "block/simulate", preset="uav", name="uav")})
    read = _run("read", {"block": _record("a", name="")})
    assert [name for name, _ in option_rows([simulated, read])] == ["block.use", "block.name"]
