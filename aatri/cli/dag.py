"""`aatri dag`: how the stages hang together, and what a run would do."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from aatri.cli.arguments.options import AsJson, LocalPlugins, RunArgument
from aatri.cli.terminal.console import reports_errors, say, say_json, say_table

if TYPE_CHECKING:
    from aatri.cli.arguments.planning import Opened
    from aatri.pipeline.plan.decisions import Plan


@reports_errors
def dag(
    run: RunArgument = None,
    dot: Annotated[bool, typer.Option("--dot", help="As Graphviz takes it.")] = False,
    local_plugins: LocalPlugins = False,
    json: AsJson = False,
) -> None:
    """Show the stages with their inputs; ports that are given but not used are in brackets."""
    from aatri.cli.arguments.planning import open_run
    from aatri.cli.plan_table import plain_decision

    opened = open_run(run, local_plugins=local_plugins)
    plan = opened.plan()
    if json:
        pairs = zip(opened.nodes, plan.decisions)
        say_json(
            [
                {
                    **plain_decision(d),
                    "use": n.method.name,
                    "from": dict(n.inputs),
                    "unused": dict(n.unused),
                    "kind": n.method.kind,
                }
                for n, d in pairs
            ]
        )
    elif dot:
        _say_dot(opened, plan)
    else:
        _say_table(opened, plan)


def _say_table(opened: Opened, plan: Plan) -> None:
    rows = []
    for node, decision in zip(opened.nodes, plan.decisions):
        used = [_port(port, source) for port, source in node.inputs.items()]
        unused = [f"({_port(port, source)})" for port, source in node.unused.items()]
        rows.append([node.name, node.method.name, ", ".join(used + unused), node.method.kind, decision.state.value])
    say_table(("stage", "method", "from", "gives", "plan"), rows)


def _say_dot(opened: Opened, plan: Plan) -> None:
    styles = {"fresh": "solid", "run": "bold", "maybe": "dashed"}
    say("digraph aatri {")
    say("  rankdir=LR; node [shape=box];")
    for node, decision in zip(opened.nodes, plan.decisions):
        say(f'  {node.name} [label="{node.name}\\n{node.method.name}", style={styles[decision.state.value]}];')
        for port, source in node.inputs.items():
            say(f'  {source} -> {node.name} [label="{port}"];')
    say("}")


def _port(port: str, source: str) -> str:
    return port if port == source else f"{port}: {source}"
