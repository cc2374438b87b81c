"""`aatri report`: write the report of a run again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aatri.cli.arguments.completion import complete_run
from aatri.cli.arguments.locate import find_run
from aatri.cli.terminal.console import reports_errors, say


@reports_errors
def report(
    run: Annotated[
        Path | None,
        typer.Argument(help="Run folder or pipeline file; default ./pipeline.yaml.", autocompletion=complete_run),
    ] = None,
) -> None:
    """Write the report of a run, also of one that failed."""
    from aatri.errors import ArtifactError
    from aatri.report.page import write_report

    found = find_run(run)
    if not found.overview:
        raise ArtifactError("has not been run", where=str(found.folder), remedy="aatri run")
    say(str(write_report(found.folder)))
