"""`aatri accept`: say that a change of code does not matter to a result."""

from pathlib import Path
from typing import Annotated

import typer

from aatri.cli.arguments.completion import complete_run, complete_stage_or_all
from aatri.cli.arguments.options import LocalPlugins
from aatri.cli.terminal.console import reports_errors, say


@reports_errors
def accept(
    stages: Annotated[
        list[str],
        typer.Argument(
            metavar="STAGE...", autocompletion=complete_stage_or_all, help="Stages, or `all` whose code has changed."
        ),
    ],
    message: Annotated[str, typer.Option("--message", "-m", metavar="WHY", help="Why it does not matter.")],
    run: Annotated[
        Path | None,
        typer.Option(autocompletion=complete_run, help="Run folder or pipeline file; default ./pipeline.yaml."),
    ] = None,
    local_plugins: LocalPlugins = False,
) -> None:
    """Let results stand in spite of changed code. Written down, with the reason; nothing is removed."""
    from aatri.cli.arguments.planning import open_run
    from aatri.errors import SpecError
    from aatri.pipeline.plan.decisions import State, select
    from aatri.pipeline.store import run_folder as store
    from aatri.pipeline.store.accept import accept as write
    from aatri.pipeline.store.lock import locked

    opened = open_run(run, local_plugins=local_plugins)
    names = [node.name for node in opened.nodes]
    select(opened.nodes, only=[name for name in stages if name != "all"])
    with locked(opened.spec.run, "aatri accept"):
        for name in names if "all" in stages else sorted(stages, key=names.index):
            decision = opened.plan().of(name)
            if decision.state is State.fresh:
                if "all" not in stages:
                    say(f"{name} is up to date")
                continue
            if decision.key is None:
                raise SpecError(
                    f"{name}: stages above it are not up to date",
                    where=str(opened.spec.run),
                    remedy="accept or run those first",
                )
            last = store.last_record(opened.spec.run, name)
            path = write(opened.spec.run, name, last, decision.parts, decision.key, message)
            say(f"{name}: accepted, see {path}")
