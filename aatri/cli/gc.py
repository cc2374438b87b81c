"""`aatri gc`: remove results that nothing refers to."""

from typing import Annotated

import typer

from aatri.cli.arguments.options import AsJson, RunArgument
from aatri.cli.terminal.console import reports_errors, say, say_json, say_table
from aatri.ids import several


@reports_errors
def gc(
    run: RunArgument = None,
    keep: Annotated[int, typer.Option(min=0, help="So many results of each stage stay beside the current one.")] = 2,
    older: Annotated[float | None, typer.Option(metavar="DAYS", min=0, help="Only what is older.")] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", "-n", help="Only show what would be removed.")] = False,
    json: AsJson = False,
) -> None:
    """Remove old results; what is current in the run or one of its variants always stays."""
    import datetime

    from aatri.cli.arguments.locate import find_run
    from aatri.pipeline.store.gc import garbage, remove
    from aatri.pipeline.store.lock import locked

    located = find_run(run)
    now = datetime.datetime.now(datetime.UTC)
    with locked(located.folder, "aatri gc", enabled=not dry_run and located.folder.is_dir()):
        results = garbage(located.folder, keep, older, now)
        if not dry_run:
            remove(located.folder, results)
    if json:
        say_json([{"stage": r.stage, "key": r.key, "ended": r.ended, "bytes": r.size} for r in results])
        return
    if results:
        rows = [[r.stage, r.key, r.ended or "incomplete", f"{r.size / 1e6:.1f}"] for r in results]
        say_table(("stage", "key", "ended (UTC)", "MB"), rows, ("MB",))
    done = "could be removed" if dry_run else "removed"
    say(f"{several(len(results), 'result')} {done}, {sum(r.size for r in results) / 1e6:.1f} MB")
