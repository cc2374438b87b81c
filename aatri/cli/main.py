"""The command `aatri`: its verbs, each imported when it is called.

Every verb is a file of this folder. What `aatri --help` says of it stands here, so that help imports none of them.
"""

import contextlib
import importlib
import os
import sys
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from aatri import __version__
from aatri.cli.examples import epilog
from aatri.errors import ResourceError

VERBS = {
    "run": "Bring a pipeline up to date and write its report",
    "check": "Say what a run would refuse, before it runs",
    "status": "Show which stages are up to date, and why others are not",
    "dag": "Show how the stages hang together",
    "show": "Show what an artifact holds and where it comes from",
    "metrics": "Show the figures of all stages of a run",
    "compare": "Show runs or variants side by side, and why they differ",
    "edit": "Write what an adjustment proposes into a file of edits that the block is read with",
    "measure": "Measure points and fiducial marks in the images of a block folder, on a page of this machine",
    "design": "Run the layouts of a pipeline of planned blocks, and put what they are worth side by side",
    "stages": "List roles and their variants, or describe one variant",
    "formats": "List the formats of other programs: what is read, what they carry",
    "export": "Export results as tables or for another program, a pipeline as a script for SLURM",
    "convert": "Write files of one program as those of another, without a run",
    "report": "Write the report of a run again, as PDF too",
    "plot": "Draw pictures of the report as SVG, PNG or PDF",
    "new": "Write a pipeline.yaml, for files of another program too, or a stage of one's own",
    "schema": "Print JSON Schemas of the pipeline and of all artifacts",
    "accept": "Let results stand in spite of changed code",
    "exec": "Make one stage, for schedulers",
    "gc": "Remove old results",
}

ELSEWHERE = {
    "import": "files of other programs are read by `aatri new --from FILE`",
    "init": "a pipeline is written by `aatri new`",
    "demo": "a pipeline of a simulated block is written by `aatri new`",
    "merge": "blocks are joined by a stage of a pipeline, see `aatri stages block/merged`",
    "diff": "runs are compared by `aatri compare`",
    "validate": "a pipeline is looked at by `aatri check`",
    "info": "artifacts are described by `aatri show`",
    "resume": "`aatri run` goes on where a run was ended",
    "clean": "old results are removed by `aatri gc`",
}
"""What other programs call a verb for, and where it is done here."""


class Verbs(TyperGroup):
    """A group of commands that are made when they are called."""

    def list_commands(self, ctx: Any) -> list[str]:  # noqa: ARG002
        """The verbs, in the order of the help."""
        return list(VERBS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:  # noqa: ARG002
        """The command of a verb, or None."""
        if cmd_name not in VERBS:
            return None
        module = importlib.import_module(f"aatri.cli.{cmd_name}")
        single = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
        single.command(cmd_name, epilog=epilog(cmd_name))(getattr(module, "exec_" if cmd_name == "exec" else cmd_name))
        return typer.main.get_command(single)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that the arguments begin with; of one that does not exist the nearest is named."""
        if args and args[0] not in VERBS:
            from aatri.ids import did_you_mean

            elsewhere = ELSEWHERE.get(args[0])
            ctx.fail(f"no verb {args[0]!r}{': ' + elsewhere if elsewhere else did_you_mean(args[0], VERBS)}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: Any, formatter: Any) -> None:  # noqa: ARG002
        """Write the verbs into the help."""
        with formatter.section("Commands"):
            formatter.write_dl(list(VERBS.items()))


app = typer.Typer(
    name="aatri",
    cls=Verbs,
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


def _open_standard_files() -> None:
    """Give stdin, stdout and stderr that are closed a place to go: else a file of the run gets their number.

    HDF5 writes its complaints to number 2, whatever is open there.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free, which is this one
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115, PTH123


def main() -> None:
    """Entry point of the command line."""
    _open_standard_files()
    if hasattr(sys.stdout, "reconfigure"):
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        if "_AATRI_COMPLETE" in os.environ:
            os.environ["NUMBA_DISABLE_JIT"] = "1"  # what the shell asks is not worth compiling for
        if os.environ.get("_AATRI_COMPLETE") == "complete_bash":
            from aatri.cli.arguments.completion import complete_in_bash

            complete_in_bash(app)
        else:
            app()
    except SystemExit as end:
        if end.code == ResourceError.exit_code:  # HDF5 crashes at exit over a file that it could not write
            with contextlib.suppress(OSError):
                sys.stdout.flush()
                sys.stderr.flush()
            os._exit(ResourceError.exit_code)
        raise
