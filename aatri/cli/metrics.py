"""`aatri metrics`: figures of all stages of a run."""

from typing import Annotated

import typer

from aatri.cli.arguments.locate import find_run
from aatri.cli.arguments.options import RunArgument
from aatri.cli.terminal.console import reports_errors, say_json, say_table
from aatri.cli.terminal.figures import number
from aatri.errors import ArtifactError


@reports_errors
def metrics(
    run: RunArgument = None,
    json: Annotated[bool, typer.Option("--json", help="As JSON: {stage: {metric: value}}.")] = False,
) -> None:
    """Show the figures of all stages of a run."""
    from aatri.cli.plan_table import warn_if_stale
    from aatri.pipeline.spec.gates import figures_of
    from aatri.pipeline.store import run_folder as store

    located = find_run(run)
    records = {entry["stage"]: store.current_record(located.folder, entry["stage"]) for entry in located.stages}
    values = {name: figures_of(record) for name, record in records.items() if record is not None}
    if not values:
        raise ArtifactError("has not been run", where=str(located.folder), remedy="aatri run")
    warn_if_stale(run, [name for name, figures in values.items() if figures])
    if json:
        say_json(values)
        return
    rows = [[stage, name, number(value)] for stage, figures in values.items() for name, value in figures.items()]
    say_table(("stage", "metric", "value"), rows, ("value",))
