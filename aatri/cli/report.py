"""`aatri report`: write the report of a run again."""

from typing import Annotated

import typer

from aatri.cli.arguments.completion import one_of_words
from aatri.cli.arguments.locate import find_run
from aatri.cli.arguments.options import OpenReport, RunArgument
from aatri.cli.terminal.console import reports_errors, say, show_in_browser


@reports_errors
def report(
    run: RunArgument = None,
    pdf: Annotated[bool, typer.Option("--pdf", help="As PDF too, by the Chromium of this machine.")] = False,
    summary: Annotated[bool, typer.Option("--summary", help="A PDF of two pages.")] = False,
    angles: Annotated[
        str,
        typer.Option(
            "--angles",
            autocompletion=one_of_words("deg", "gon"),
            metavar="UNIT",
            help="deg (with arcseconds) or gon (with mgon); kept when the report is written again.",
        ),
    ] = "",
    open_: OpenReport = False,
) -> None:
    """Write the report of a run, also of one that failed."""
    from aatri.errors import ArtifactError, SpecError
    from aatri.ids import did_you_mean
    from aatri.report.page import write_report
    from aatri.report.printing import write_pdf
    from aatri.report.view.numbers import ANGLES

    if angles and angles not in ANGLES:
        raise SpecError(f"no unit of angles {angles!r}{did_you_mean(angles, ANGLES)}", remedy="deg or gon")
    located = find_run(run)
    if not located.overview:
        raise ArtifactError("has not been run", where=str(located.folder), remedy="aatri run")
    page = write_report(located.folder, angles)
    say(str(page))
    for asked, short in ((pdf, False), (summary, True)):
        if asked:
            say(str(write_pdf(located.folder, summary=short)))
    if open_:
        show_in_browser(page)
