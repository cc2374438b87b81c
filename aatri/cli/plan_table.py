"""A plan as `run --dry-run`, `status` and `dag` show it."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING, Any

from aatri.cli.terminal.console import narrate, say, say_table
from aatri.errors import AatriError, Errors

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence
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


def warn_if_stale(named: Path | None, stages: Collection[str]) -> None:
    """Say which results that are shown are not, or may not be, what the pipeline would make now; compiles nothing."""
    from aatri.cli.arguments.locate import find_run
    from aatri.cli.arguments.planning import open_run
    from aatri.pipeline.plan.decisions import State

    of_run = "" if named is None else f" {shlex.quote(str(named))}"
    try:
        if (find_run(named).overview.get("request") or {}).get("local_plugins"):
            narrate(f"note: made with --local-plugins: `aatri status{of_run} --local-plugins` says what is up to date")
            return
        decisions = open_run(named, quiet=True, compiles=False).plan().decisions
    except AatriError as error:
        first = error.errors[0] if isinstance(error, Errors) else error
        text = f"{first.where}: {first.what}" if first.where else first.what
        remedy = f" ({first.remedy})" if first.remedy else ""
        narrate(f"note: whether this is up to date is not known: {text}{remedy}")
        return
    for state, adverb in ((State.run, "not"), (State.maybe, "perhaps not")):
        stale = [d for d in decisions if d.state is state and d.stage in stages]
        if stale:
            names = ", ".join(f"{d.stage} ({reasons_text(d.reasons[:1])})" for d in stale)
            again = "it" if len(stale) == 1 else "them"
            narrate(f"warning: {adverb} up to date: {names}; `aatri run{of_run}` makes {again} again")
