"""A plan as `run --dry-run`, `status` and `dag` show it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from aatri.cli.terminal.console import narrate, say, say_table
from aatri.errors import AatriError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from aatri.cli.arguments.planning import Opened
    from aatri.pipeline.plan.decisions import Decision, Plan
    from aatri.pipeline.plan.reasons import Reason


def plain_plan(plan: Plan) -> dict[str, Any]:
    """The plan as JSON takes it."""
    return {"stages": [plain_decision(decision) for decision in plan.decisions]}


def plain_decision(decision: Decision) -> dict[str, Any]:
    """A decision as JSON takes it."""
    return {
        "stage": decision.stage,
        "decision": decision.state.value,
        "selected": decision.selected,
        "key": decision.key,
        "accepted": decision.accepted,
        "reasons": [{**reason.plain(), "text": str(reason)} for reason in decision.reasons],
    }


def say_plan(opened: Opened, plan: Plan) -> None:
    """A line per stage: what is to be done and why."""
    rows = []
    for node, decision in zip(opened.nodes, plan.decisions, strict=True):
        state = decision.state.value if decision.selected else "not selected"
        rows.append([node.name, node.method.name, state, reasons_of(decision)])
    say_table(("stage", "method", "plan", "why"), rows)
    say()
    say(f"{len(plan.stale)} of {len(plan.decisions)} stages to do" if plan.stale else "all stages are up to date")


def reasons_of(decision: Decision) -> str:
    """The reasons in a line."""
    if decision.accepted:
        return "accepted in spite of other code"
    return reasons_text(decision.reasons)


def reasons_text(reasons: Sequence[Reason]) -> str:
    """Reasons in a line; the stages above that are made again are named together."""
    texts = [str(reason) for reason in reasons if reason.why != "upstream_maybe"]
    above = [reason.about for reason in reasons if reason.why == "upstream_maybe"]
    if above:
        texts.append(f"perhaps other {', '.join(above)}")
    return "; ".join(texts)


def warn_if_stale(named: Path | None, stage: str = "") -> None:
    """Say which results of a run, or that of a stage, are not what its pipeline would make now."""
    from aatri.cli.arguments.planning import open_run

    try:
        decisions = open_run(named, quiet=True, background=True).plan().decisions
    except AatriError as error:
        narrate(f"note: whether this is up to date is not known: {error.what}")
        return
    stale = [d for d in decisions if d.record is None and stage in ("", d.stage)]
    if stale:
        names = ", ".join(d.stage for d in stale)
        narrate(f"warning: not up to date: {names} ({reasons_text(stale[0].reasons[:1])}); `aatri run` makes it again")
