"""`aatri plot`: pictures of the report as SVG, PNG or PDF."""

import contextlib
from pathlib import Path
from typing import Annotated

import typer

from aatri.cli.arguments.completion import complete_path, complete_run, one_of_words
from aatri.cli.arguments.locate import find_run
from aatri.cli.terminal.console import reports_errors, say, say_table


def complete_picture(ctx: typer.Context, incomplete: str) -> list[str]:
    """Pictures of the run that the command line names, for the shell."""
    with contextlib.suppress(Exception):
        from aatri.report.page import seen_in
        from aatri.report.questions import all_pictures

        names = ["all", *all_pictures(*seen_in(find_run(Path(ctx.params["run"])).folder))]
        return [name for name in names if name.startswith(incomplete)]
    return []


@reports_errors
def plot(
    run: Annotated[Path, typer.Argument(help="Run folder or pipeline file.", autocompletion=complete_run)],
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[NAME]...",
            autocompletion=complete_picture,
            help="Of pictures, or `all`; without any, they are listed.",
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
    from aatri.errors import SpecError
    from aatri.formats.text.written_files import write_files
    from aatri.ids import did_you_mean
    from aatri.report.page import seen_in
    from aatri.report.plotting import FORMATS, plotted
    from aatri.report.questions import all_pictures

    if form not in FORMATS:
        raise SpecError(f"no format {form!r}{did_you_mean(form, FORMATS)}", remedy=f"one of {', '.join(FORMATS)}")
    pictures = all_pictures(*seen_in(find_run(run).folder))
    if not names:
        say_table(("name", "picture"), [[name, picture.title] for name, picture in pictures.items()])
        return
    for name in names:
        if name != "all" and name not in pictures:
            remedy = f"one of {', '.join(pictures)}" if pictures else "the run has none"
            raise SpecError(f"no picture {name!r}{did_you_mean(name, pictures)}", where=str(run), remedy=remedy)
    asked = list(pictures) if "all" in names else names
    files = {f"{_plain(name)}.{form}": plotted(pictures[name], form) for name in asked}
    write_files(into, files)
    for file in files:
        say(str(into / file))


def _plain(name: str) -> str:
    """A name as a file name: ids of cameras may have anything."""
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in name)
