"""`aatri report`: write the report of a run again."""

from typing import Annotated

import typer

from aatri.cli.arguments.locate import find_run
from aatri.cli.arguments.options import OpenReport, RunArgument
from aatri.cli.terminal.console import reports_errors, say, show_in_browser


@reports_errors
def report(
    run: RunArgument = None,
    pdf: Annotated[bool, typer.Option("--pdf", help="As PDF too, by the Chromium of this machine.")] = False,
    summary: Annotated[bool, typer.Option("--summary", help="A PDF of two pages.")] = False,
    open_: OpenReport = False,
) -> None:
    """Write the report of a run, also of one that failed."""
    from aatri.errors import ArtifactError
    from aatri.report.page import write_report
    from aatri.report.printing import write_pdf

    located = find_run(run)
    if not located.overview:
        raise ArtifactError("has not been run", where=str(located.folder), remedy="aatri run")
    page = write_report(located.folder)
    say(str(page))
    for asked, short in ((pdf, False), (summary, True)):
        if asked:
            say(str(write_pdf(located.folder, summary=short)))
    if open_:
        show_in_browser(page)
