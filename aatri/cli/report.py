"""`aatri report`: write the report of a run again."""

from aatri.cli.arguments.locate import find_run
from aatri.cli.arguments.options import RunArgument
from aatri.cli.terminal.console import reports_errors, say


@reports_errors
def report(
    run: RunArgument = None,
) -> None:
    """Write the report of a run, also of one that failed."""
    from aatri.errors import ArtifactError
    from aatri.report.page import write_report

    located = find_run(run)
    if not located.overview:
        raise ArtifactError("has not been run", where=str(located.folder), remedy="aatri run")
    say(str(write_report(located.folder)))
