"""`aatri status`: which stages of a run are done."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from aatri.cli.console import reports_errors, say, say_json, say_table
from aatri.cli.locate import Run, find_run


@reports_errors
def status(
    run: Annotated[Path | None, typer.Argument(help="Run folder or pipeline file; default ./pipeline.yaml.")] = None,
    json: Annotated[bool, typer.Option("--json", help="As JSON.")] = False,
) -> None:
    """Show which stages of a run are done."""
    found = find_run(run)
    stages = [_state(found, entry) for entry in found.stages]
    if json:
        say_json({"run": str(found.folder), "status": found.overview.get("status", "not run"), "stages": stages})
        return
    say(f"run {found.folder}: {found.overview.get('status', 'not run')}")
    rows = [[s["stage"], s["use"], s["state"], s.get("ended", ""), _detail(s)] for s in stages]
    say_table(("stage", "method", "state", "ended (UTC)", ""), rows)


def _state(run: Run, entry: dict[str, Any]) -> dict[str, Any]:
    from aatri.pipeline import store

    name = entry["stage"]
    head = {"stage": name, "use": entry["use"]}
    failure = store.failure(run.folder, name)
    if failure is not None:
        kept = ("exit_code", "what", "where", "remedy", "ended")
        return {**head, "state": "failed", **{key: failure[key] for key in kept}}
    record = store.current_record(run.folder, name)
    if record is None:
        return {**head, "state": "not run"}
    path = store.artifact_path(run.folder, name)
    intact = path.is_file() and path.stat().st_size == record["output"]["size"]
    state = "altered" if not intact else "done" if record["plugin"] == entry["use"] else f"done by {record['plugin']}"
    return {**head, "state": state, "key": record["key"], "ended": record["ended"], "seconds": record["seconds"],
            "warnings": len(record["warnings"])}  # fmt: skip


def _detail(state: dict[str, Any]) -> str:
    if state["state"] == "failed":
        return f"{state['where']}: {state['what']}" if state["where"] else str(state["what"])
    if state.get("warnings"):
        return f"{state['seconds']:.2f} s, {state['warnings']} warnings"
    return f"{state['seconds']:.2f} s" if "seconds" in state else ""
