"""`aatri status`: which stages of a run are up to date, and why others are not."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from aatri.cli.arguments.options import AsJson, LocalPlugins, RunArgument, Verify
from aatri.cli.terminal.console import reports_errors, say, say_json, say_table
from aatri.ids import several

if TYPE_CHECKING:
    from aatri.cli.arguments.planning import Opened
    from aatri.pipeline.plan.decisions import Decision


@reports_errors
def status(
    run: RunArgument = None,
    verify: Verify = False,
    local_plugins: LocalPlugins = False,
    json: AsJson = False,
) -> None:
    """Show which stages of a run are up to date, and what a run would do, and why."""
    from aatri.cli.arguments.planning import open_run
    from aatri.pipeline.spec.gates import verdicts_in
    from aatri.pipeline.store import run_folder as store

    opened = open_run(run, local_plugins=local_plugins)
    plan = opened.plan(verify=verify)
    overview = store.read_overview(opened.spec.run) or {}
    stages = [_state(opened, decision, node.method.name) for node, decision in zip(opened.nodes, plan.decisions)]
    ended = overview.get("status", "not run")
    if json:
        gates = [verdict.plain() for verdict in verdicts_in(overview)]
        say_json({"run": str(opened.spec.run), "status": ended, "stages": stages, "gates": gates})
        return
    say(f"run {opened.spec.run}: {ended}")
    rows = [[s["stage"], s["use"], s["state"], s.get("ended", ""), _detail(s)] for s in stages]
    say_table(("stage", "method", "state", "ended (UTC)", ""), rows)
    for verdict in verdicts_in(overview):
        if not verdict.passed:
            say(f"gate failed: {verdict}")


def _state(opened: Opened, decision: Decision, use: str) -> dict[str, Any]:
    from aatri.cli.plan_table import plain_decision, reasons_of
    from aatri.pipeline.store import run_folder as store

    head = {**plain_decision(decision), "use": use, "why": reasons_of(decision)}
    record = decision.record
    if record is not None:
        return {
            **head,
            "state": "done",
            "key": record["key"],
            "ended": record["ended"],
            "seconds": record["seconds"],
            "warnings": len(record["warnings"]),
        }
    reasons = {reason["why"] for reason in head["reasons"]}
    failure = store.failure(opened.spec.run, decision.stage)
    if failure is not None and ("failed_before" in reasons or decision.key is None):
        return {**head, "state": "failed", **{key: failure[key] for key in ("exit_code", "what", "where", "ended")}}
    if "output_altered" in reasons:
        return {**head, "state": "altered"}
    if reasons & {"never_run", "interrupted"}:
        return {**head, "state": "not run"}
    return {**head, "state": "perhaps stale" if decision.state.value == "maybe" else "stale"}


def _detail(state: dict[str, Any]) -> str:
    if state["state"] == "failed":
        return f"{state['where']}: {state['what']}" if state["where"] else str(state["what"])
    if state["accepted"]:
        return "accepted in spite of other code"
    if state["state"] == "done":
        more = f", {several(state['warnings'], 'warning')}" if state["warnings"] else ""
        return f"{state['seconds']:.2f} s{more}"
    return str(state["why"])
