"""`aatri plot`: pictures of the report as SVG, PNG or PDF."""

import contextlib
import itertools
import json
from pathlib import Path
from typing import Annotated

import typer

from aatri.cli.arguments.completion import complete_path, complete_run, one_of_words
from aatri.cli.arguments.locate import find_run
from aatri.cli.terminal.console import reports_errors, say, say_table


def complete_picture(ctx: typer.Context, incomplete: str) -> list[str]:
    """Pictures of the run that the command line names and their questions, as its report.json lists them."""
    with contextlib.suppress(Exception):
        page = json.loads((find_run(Path(ctx.params["run"])).folder / "report.json").read_text(encoding="utf-8"))
        by_question = {question: names for question, names in page["pictures"].items() if names}
        every = dict.fromkeys(["all", *by_question, *itertools.chain(*by_question.values())])
        return [name for name in every if name.startswith(incomplete)]
    return []


@reports_errors
def plot(
    run: Annotated[Path, typer.Argument(help="Run folder or pipeline file.", autocompletion=complete_run)],
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[NAME]...",
            autocompletion=complete_picture,
            help="Of pictures or questions, or `all`; without any, they are listed.",
        ),
    ] = None,
    form: Annotated[
        str, typer.Option("--format", autocompletion=one_of_words("svg", "png", "pdf"), help="svg, png or pdf.")
    ] = "svg",
    into: Annotated[
        Path, typer.Option("--into", autocompletion=complete_path, help="Folder of the files.", metavar="DIR")
    ] = Path(),
) -> None:
    """Draw pictures of the report by matplotlib, each as a file."""
    from aatri.formats.text.written_files import write_files
    from aatri.report.page import seen_in
    from aatri.report.plotting import file_name, plotted
    from aatri.report.questions import gallery

    there = gallery(*seen_in(find_run(run).folder))
    if not names:
        rows = [[name, there.pictures[name].title, q] for q, listed in there.questions.items() for name in listed]
        say_table(("name", "picture", "of"), rows)
        return
    chosen = there.chosen(names, str(run))
    files = {file_name(picture, form): plotted(picture, form) for picture in chosen.values()}
    write_files(into, files)
    for file in files:
        say(str(into / file))
