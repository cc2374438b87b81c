"""`aatri run`: run a pipeline."""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from aatri.cli.console import is_terminal, narrate, reports_errors, say
from aatri.cli.figures import highlights, say_result
from aatri.errors import SpecError

TERMINATED = 143


@reports_errors
def run(
    pipeline: Annotated[Path, typer.Argument(help="The pipeline file.")] = Path("pipeline.yaml"),
    into: Annotated[Path | None, typer.Option(help="Folder of the results instead of `run:`.", metavar="DIR")] = None,
    set_: Annotated[
        list[str] | None, typer.Option("--set", metavar="STAGE.OPTION=VALUE", help="Set an option; may be repeated.")
    ] = None,
    use: Annotated[
        list[str] | None, typer.Option(metavar="STAGE=ROLE/VARIANT", help="Swap a method; may be repeated.")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No narration, only the result.")] = False,
    debug: Annotated[bool, typer.Option(help="Show tracebacks.")] = False,
) -> None:
    """Run a pipeline and write its report."""
    if not pipeline.exists() and pipeline == Path("pipeline.yaml"):
        raise SpecError(
            "no pipeline.yaml in this folder", remedy="`aatri new` writes one here, or give the path of one"
        )
    from aatri.pipeline.graph import wire
    from aatri.pipeline.overrides import with_set, with_use
    from aatri.pipeline.registry import find_stages
    from aatri.pipeline.runner import run_pipeline
    from aatri.pipeline.spec import load_spec

    signal.signal(signal.SIGTERM, lambda *_: sys.exit(TERMINATED))
    registry = find_stages()
    spec, notes = with_use(load_spec(pipeline, into), use or [], registry)
    spec = with_set(spec, set_ or [])
    nodes = wire(spec, registry)
    for note in notes:
        narrate(f"note: {note}")
    try:
        records = run_pipeline(spec, nodes, _Narrator(quiet))
    except Exception:
        _write_report(spec.run, debug=debug)
        raise
    report = _write_report(spec.run, debug=debug)
    say_result(records)
    say()
    say(f"run     {spec.run}")
    say(f"report  {report}" if report else "report  not written, see the warning above")


def _write_report(folder: Path, *, debug: bool) -> Path | None:
    """Write the report; if that fails, the run's own outcome must still be told."""
    try:
        from aatri.report.page import write_report

        path: Path = write_report(folder)
    except Exception as error:
        if debug:
            import traceback

            narrate(traceback.format_exc())
        narrate(f"warning: no report: {type(error).__name__}: {error}")
        return None
    return path


class _Narrator:
    """Tells what happens during a run, on stderr."""

    def __init__(self, quiet: bool) -> None:
        self._quiet = quiet
        self._live = is_terminal() and not quiet
        self._shown = 0.0
        self._head = ""

    def started(self, stage: str, use: str, number: int, total: int) -> None:
        """Remember how the line of the stage begins."""
        self._head = f"[{number:{len(str(total))}}/{total}] {stage}"
        self._overwrite(f"{self._head}: {use} ...")

    def warned(self, stage: str, message: str) -> None:
        """Warnings are shown even when quiet."""
        self._overwrite("")
        narrate(f"warning: {stage}: {message}")

    def advanced(self, stage: str, done: int, total: int, what: str) -> None:  # noqa: ARG002
        """Show the progress on a terminal, at most ten times a second."""
        if time.monotonic() - self._shown > 0.1:
            self._shown = time.monotonic()
            self._overwrite(f"{self._head}: {what} {done}/{total}")

    def finished(self, record: Mapping[str, Any]) -> None:
        """One line per stage."""
        self._overwrite("")
        if not self._quiet:
            narrate(f"{self._head}  {record['seconds']:.2f} s  {highlights(record['metrics'])}")

    def failed(self, stage: str, folder: Path) -> None:  # noqa: ARG002
        """Say where the log is; the error itself follows at the end."""
        self._overwrite("")
        narrate(f"{self._head}  failed; log: {folder / 'stage.log'}")

    def _overwrite(self, text: str) -> None:
        if self._live:
            typer.echo(f"\r\x1b[K{text[:100]}", nl=False, err=True)
