"""`aatri run`: bring a pipeline up to date."""

from __future__ import annotations

import shlex
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import typer

from aatri.cli.arguments.completion import complete_run, complete_stage, one_of_words
from aatri.cli.arguments.options import (
    Debug,
    Into,
    LocalPlugins,
    Methods,
    NoLock,
    OpenReport,
    Settings,
    Several,
    Variant,
    Verify,
)
from aatri.cli.terminal.console import is_terminal, narrate, reports_errors, say_json, show_in_browser
from aatri.ids import several

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from aatri.cli.arguments.planning import Opened, Request
    from aatri.errors import GateError
    from aatri.pipeline.plan.decisions import Selection
    from aatri.pipeline.spec.gates import Verdict
    from aatri.tables.schema import Artifact

TERMINATED = 143


PipelineArgument: TypeAlias = Annotated[
    Path,
    typer.Argument(
        autocompletion=complete_run,
        help="The pipeline file, or the folder that it is in; or the folder of a run, which is made again as it was.",
    ),
]
AllVariants: TypeAlias = Annotated[
    bool, typer.Option("--all-variants", help="All variants of the pipeline file too, and what they change.")
]
From: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--from", metavar="STAGE", autocompletion=complete_stage, help="Only this stage and what depends on it."
    ),
]
Until: TypeAlias = Annotated[
    str | None,
    typer.Option(metavar="STAGE", autocompletion=complete_stage, help="Only this stage and what it needs."),
]
Only: TypeAlias = Annotated[
    Several, typer.Option(metavar="STAGE", autocompletion=complete_stage, help="Only this stage; may be repeated.")
]
Force: TypeAlias = Annotated[
    Several,
    typer.Option(
        metavar="STAGE", autocompletion=complete_stage, help="Make this stage again, or `all`; may be repeated."
    ),
]
KeepGoing: TypeAlias = Annotated[
    bool, typer.Option("--keep-going", "-k", help="After a failure go on with what does not depend on it.")
]
Jobs: TypeAlias = Annotated[int, typer.Option("--jobs", "-j", min=1, help="Stages at once, each in its own process.")]
Cluster: TypeAlias = Annotated[
    str,
    typer.Option(
        metavar="ADDRESS",
        autocompletion=one_of_words("local:", "tcp://"),
        help="Stages on a Dask cluster: tcp://HOST:PORT, or local:WORKERS[:MEMORY].",
    ),
]
DryRun: TypeAlias = Annotated[bool, typer.Option("--dry-run", "-n", help="Show what would be done, and why.")]
Quiet: TypeAlias = Annotated[bool, typer.Option("--quiet", "-q", help="No narration, only the result.")]
Verbose: TypeAlias = Annotated[bool, typer.Option("--verbose", "-v", help="Tell what stages write to their logs too.")]
ResultAsJson: TypeAlias = Annotated[bool, typer.Option("--json", help="The result as JSON.")]


@reports_errors
def run(
    pipeline: PipelineArgument = Path("pipeline.yaml"),
    into: Into = None,
    set_: Settings = None,
    use: Methods = None,
    variant: Variant = "",
    all_variants: AllVariants = False,
    start: From = None,
    until: Until = None,
    only: Only = None,
    force: Force = None,
    keep_going: KeepGoing = False,
    jobs: Jobs = 1,
    cluster: Cluster = "",
    dry_run: DryRun = False,
    verify: Verify = False,
    no_lock: NoLock = False,
    local_plugins: LocalPlugins = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
    open_: OpenReport = False,
    json: ResultAsJson = False,
    debug: Debug = False,
) -> None:
    """Bring a pipeline up to date and write its report; what is up to date already is left alone."""
    from aatri.cli.arguments.locate import in_folder
    from aatri.cli.arguments.planning import Request
    from aatri.errors import SpecError
    from aatri.pipeline.plan.decisions import select
    from aatri.pipeline.run.workers import share_cores
    from aatri.pipeline.spec.gates import failure_of, judge

    signal.signal(signal.SIGTERM, _terminate)
    share_cores(jobs)
    pipeline = in_folder(pipeline)
    if all_variants and (variant or json or dry_run or pipeline.is_dir()):
        raise SpecError(
            "all variants are run of a pipeline file, and compared",
            where=str(pipeline),
            remedy="--all-variants without --variant, --json and --dry-run",
        )
    request = Request(str(pipeline), str(into or ""), tuple(set_ or ()), tuple(use or ()), variant, local_plugins)
    opened = _opened(request, quiet=quiet or json, background=not dry_run)
    selection = select(opened.nodes, start=start, until=until, only=only or (), force=force or ())
    if dry_run:
        from aatri.cli.plan_table import plain_plan, say_plan

        planned = opened.plan(selection, verify=verify)
        say_json(plain_plan(planned)) if json else say_plan(opened, planned)
        return
    if cluster and jobs > 1:
        raise SpecError("--jobs beside --cluster", remedy="a cluster has the number of its workers")
    running = {"jobs": jobs, "cluster": cluster, "keep_going": keep_going, "verify": verify, "lock": not no_lock}
    running["in_memory"] = {}  # stages that variants share stay in memory, and are not read again by each
    warnings: list[tuple[str, str]] = []
    records, report = carry_out(
        opened, selection, running, quiet=quiet or json, verbose=verbose, debug=debug, open_=open_, warnings=warnings
    )
    verdicts = judge(opened.spec, records, selection.stages)
    above = warnings if sys.stdout.isatty() and is_terminal() else []
    _say_outcome(opened.spec.run, records, report, verdicts, above, as_json=json)
    if open_ and report is not None:
        show_in_browser(report)
    failed = failure_of(verdicts)
    if all_variants:
        from aatri.cli.run_variants import run_variants

        def of_variant(one: Opened) -> GateError | None:
            chosen = select(one.nodes, start=start, until=until, only=only or (), force=())
            records, _ = carry_out(one, chosen, running, quiet=quiet, verbose=verbose, debug=debug)
            return failure_of(judge(one.spec, records, chosen.stages))

        run_variants(opened, failed, of_variant)
    elif failed is not None:
        raise failed


def _opened(request: Request, *, quiet: bool, background: bool) -> Opened:
    """The pipeline of a file, or that of the folder of a run."""
    from aatri.cli.arguments.planning import open_request, open_run
    from aatri.errors import SpecError

    if not Path(request.pipeline).is_dir():
        return open_request(request, quiet=quiet, background=background)
    if request.into or request.variant:
        raise SpecError(
            "a run has its folder and its variant",
            where=request.pipeline,
            remedy="give the pipeline file with --into or --variant",
        )
    return open_run(
        Path(request.pipeline),
        local_plugins=request.local_plugins,
        set_=request.set_,
        use=request.use,
        quiet=quiet,
        background=background,
    )


def _say_outcome(
    folder: Path,
    records: list[dict[str, Any]],
    report: Path | None,
    verdicts: Sequence[Verdict],
    above: Sequence[tuple[str, str]],
    *,
    as_json: bool,
) -> None:
    if as_json:
        gates = [verdict.plain() for verdict in verdicts]
        say_json({"run": str(folder), "report": str(report), "stages": records, "gates": gates})
    else:
        from aatri.cli.run_ending import say_end

        say_end(folder, records, report, verdicts, above)


def carry_out(
    opened: Opened,
    selection: Selection,
    running: dict[str, Any],
    *,
    quiet: bool,
    debug: bool,
    verbose: bool = False,
    open_: bool = False,
    warnings: list[tuple[str, str]] | None = None,
) -> tuple[list[dict[str, Any]], Path | None]:
    """Run; whatever ends it, write the report and say how to go on. `warnings` takes those that are told meanwhile."""
    from aatri.cli.terminal.narrator import Narrator
    from aatri.errors import AatriError, ResourceError, SpecError
    from aatri.pipeline.run.runner import RunSettings, run_pipeline

    folder, events = opened.spec.run, opened.spec.run / "events.jsonl"
    before = events.stat().st_size if events.exists() else 0
    compiled = opened.compilation.wait if opened.compilation else None
    settings = RunSettings(
        selection,
        command=_command(),
        source=opened.source,
        request=opened.request.plain(),
        compiled=compiled,
        **running,
    )
    try:
        with Narrator(quiet, opened.compilation, verbose=verbose) as narrator:
            records = run_pipeline(opened.spec, opened.nodes, narrator, settings)
            if warnings is not None:
                warnings += narrator.warnings
    except BaseException as error:
        began = events.exists() and events.stat().st_size != before
        if isinstance(error, AatriError) and began and not isinstance(error, SpecError | ResourceError):
            report = _write_report(folder, settings.in_memory, debug=debug)
            if report is not None and not quiet:
                narrate(f"report  {report}")
            if report is not None and open_:
                show_in_browser(report)
        if began:
            narrate(f"what was made stays; to go on: {_command()}")
        raise
    report = folder / "report.html"
    if report.exists() and events.exists() and events.stat().st_size == before:
        if not quiet:
            narrate(f"nothing to do: {several(len(records), 'stage')} up to date")
        return records, report
    return records, _write_report(folder, settings.in_memory, debug=debug)


def _write_report(folder: Path, in_memory: Mapping[str, Artifact], *, debug: bool) -> Path | None:
    """Write the report; if that fails, the run's own outcome must still be told."""
    try:
        from aatri.report.page import write_report

        path: Path = write_report(folder, in_memory=in_memory)
    except Exception as error:
        if debug:
            import traceback

            narrate(traceback.format_exc())
        narrate(f"warning: no report: {type(error).__name__}: {error}")
        return None
    return path


def _command() -> str:
    """The command as it was typed."""
    return shlex.join(["aatri", *sys.argv[1:]])


def _terminate(*_: object) -> None:
    """SIGTERM ends the run like an error would; a second one ends it at once."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    sys.exit(TERMINATED)
