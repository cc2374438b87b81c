"""`aatri exec`: make one stage, for schedulers."""

from pathlib import Path
from typing import Annotated

import typer

from aatri.cli.arguments.completion import complete_run, complete_stage
from aatri.cli.arguments.options import Debug, Into, LocalPlugins, Methods, NoLock, Settings, Variant
from aatri.cli.terminal.console import narrate, reports_errors, say


@reports_errors
def exec_(
    run: Annotated[Path, typer.Argument(help="Run folder or pipeline file.", autocompletion=complete_run)],
    stage: Annotated[str, typer.Argument(help="The stage.", autocompletion=complete_stage)],
    into: Into = None,
    set_: Settings = None,
    use: Methods = None,
    variant: Variant = "",
    force: Annotated[bool, typer.Option(help="Make it again.")] = False,
    local_plugins: LocalPlugins = False,
    no_lock: NoLock = False,
    debug: Debug = False,
) -> None:
    """Make one stage whose inputs are up to date, beside other jobs on other stages of the run."""
    del debug  # for reports_errors
    from aatri.cli.arguments.locate import in_folder
    from aatri.cli.arguments.planning import Request, open_request, open_run
    from aatri.cli.terminal.narrator import Narrator
    from aatri.pipeline.plan.decisions import Selection, select
    from aatri.pipeline.run.runner import RunSettings
    from aatri.pipeline.run.single import make_stage
    from aatri.pipeline.run.workers import share_cores

    share_cores(1)
    run = in_folder(run)
    request = Request(str(run), str(into or ""), tuple(set_ or ()), tuple(use or ()), variant, local_plugins)
    opened = open_run(run, local_plugins=local_plugins) if run.is_dir() else open_request(request)
    select(opened.nodes, only=[stage])
    settings = RunSettings(
        Selection(forced=frozenset({stage} if force else ())),
        lock=not no_lock,
        command=f"aatri exec {stage}",
        source=opened.source,
        request=opened.request.plain(),
    )
    with Narrator(quiet=False) as narrator:
        record, made = make_stage(opened.spec, opened.nodes, stage, narrator, settings)
    if not made:
        narrate(f"{stage} is up to date")
    say(f"{stage} {record['key']} {record['output']['content_digest']}")
