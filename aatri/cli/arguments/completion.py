"""What the shell completes: stages and variants of the pipeline, runs, and stages of a run (`RUN:STAGE`).

Nothing here may fail or be slow: what cannot be read completes nothing.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from aatri.pipeline.spec.pipeline_file import Spec

MOST = 200
"""More entries of a folder are not looked at."""


def complete_stage(ctx: typer.Context, incomplete: str) -> list[str]:
    """Stages of the pipeline the command names, or of ./pipeline.yaml."""
    spec = _spec(ctx)
    return _starting(incomplete, spec.stages if spec else ())


def complete_variant(ctx: typer.Context, incomplete: str) -> list[str]:
    """Variants of the pipeline."""
    spec = _spec(ctx)
    return _starting(incomplete, spec.variants if spec else ())


def complete_run(incomplete: str) -> list[str]:
    """Run folders and pipeline files below the folder typed so far."""
    return _starting(incomplete, _runs(incomplete))


def complete_run_stage(incomplete: str) -> list[str]:
    """Runs, and after `RUN:` the stages of that run."""
    run, colon, _ = incomplete.rpartition(":")
    if not colon:
        return _starting(incomplete, _runs(incomplete))
    from aatri.cli.arguments.locate import find_run

    with contextlib.suppress(Exception):
        located = find_run(Path(run) if run else None)
        return _starting(incomplete, [f"{run}:{entry['stage']}" for entry in located.stages])
    return []


def _starting(incomplete: str, names: Iterable[str]) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]


def _spec(ctx: typer.Context) -> Spec | None:
    """The pipeline file of a command line that is not complete yet."""
    from aatri.cli.arguments.locate import DEFAULT, in_folder
    from aatri.pipeline.spec.pipeline_file import load_spec

    named = ctx.params.get("pipeline") or ctx.params.get("run") or DEFAULT
    with contextlib.suppress(Exception):
        path = in_folder(Path(named))
        return load_spec(path if path.is_file() else DEFAULT)
    return None


def _runs(incomplete: str) -> list[str]:
    """Folders with a run.json, and pipeline files, in the folder typed so far and one below it."""
    typed = incomplete.rpartition("/")[0]
    runs = []
    with contextlib.suppress(OSError):
        entries = sorted(Path(typed or ".").iterdir())[:MOST]
        for entry in entries:
            if entry.is_dir():
                below = sorted(entry.iterdir())[:MOST] if not (entry / "run.json").is_file() else [entry]
                runs += [str(folder) for folder in below if (folder / "run.json").is_file()]
            elif entry.suffix in (".yaml", ".yml") and entry.name.startswith("pipeline"):
                runs.append(str(entry))
    return runs
