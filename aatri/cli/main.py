"""The command `aatri`."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from aatri import __version__
from aatri.cli import accept, compare, dag, exec, export, gc, metrics, new, report, run, schema, show, stages, status

app = typer.Typer(
    name="aatri",
    help="Analytical aerial triangulation: from image measurements to oriented images and ground points.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def _version(asked: bool) -> None:
    if asked:
        typer.echo(f"aatri {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    del version


app.command()(run.run)
app.command()(status.status)
app.command()(dag.dag)
app.command()(show.show)
app.command()(metrics.metrics)
app.command()(stages.stages)
app.command()(export.export)
app.command()(new.new)
app.command()(schema.schema)
app.command()(report.report)
app.command()(compare.compare)
app.command()(accept.accept)
app.command("exec")(exec.exec_)
app.command()(gc.gc)


def main() -> None:
    """Entry point of the command line."""
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(errors="backslashreplace")
    app()
