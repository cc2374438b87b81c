"""`aatri export`: artifacts as tables or files of other programs, a pipeline as a script for SLURM."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aatri.cli.arguments.completion import complete_path, complete_run_stage
from aatri.cli.arguments.exporting import check_folder, complete_written, write_format
from aatri.cli.arguments.locate import LocatedRun, find_run, split_stage
from aatri.cli.arguments.options import LensMisfit, ListAngle, ListColumns, ListRotation, Overwrite
from aatri.cli.terminal.console import narrate, reports_errors, say
from aatri.errors import ArtifactError, ResourceError, SpecError
from aatri.ids import printable
from aatri.pipeline.run.overview import arguments_of

if TYPE_CHECKING:
    from aatri.artifacts.block import Block
    from aatri.cli.arguments.planning import Opened
    from aatri.formats.results.oriented_block import OrientedBlock

_HEAD = """\
#!/usr/bin/env bash
# Submits the stages of {pipeline} to SLURM, each waiting for those it needs.
# Arguments go to sbatch: bash {name} --partition=long --cpus-per-task=8
set -euo pipefail
cd {folder}
submit() {{  # NAME DEPENDENCIES COMMAND
    local name=$1 after=$2; shift 2
    sbatch --parsable --job-name="aatri-$name" ${{after:+--dependency=afterok:$after}} --kill-on-invalid-dep=yes \\
        "${{options[@]}}" --wrap "$*"
}}
options=("$@")
"""

OTHERS = ("slurm",)
"""Forms that are no format of blocks."""


def _complete(incomplete: str) -> list[str]:
    return complete_written(incomplete) + [form for form in OTHERS if form.startswith(incomplete)]


@reports_errors
def export(
    what: Annotated[
        str,
        typer.Argument(
            metavar="RUN[:STAGE]", autocompletion=complete_run_stage, help="Without STAGE the last Solution."
        ),
    ],
    form: Annotated[
        str,
        typer.Argument(metavar="FORMAT", autocompletion=_complete, help="tables, slurm, or a format that is written."),
    ],
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", autocompletion=complete_path, help="Folder to write to; for slurm a file.")
    ],
    overwrite: Overwrite = False,
    measured: Annotated[
        bool, typer.Option("--measured", help="Image points as measured, with the distortion of the cameras.")
    ] = False,
    columns: ListColumns = None,
    angle: ListAngle = None,
    rotation: ListRotation = None,
    lens_misfit: LensMisfit = 0.05,
) -> None:
    """Export results as tables or for another program (`aatri formats`), a pipeline for SLURM.

    The image points of a Solution are written free of all that was corrected, with cameras without distortion, or, with
    --measured, as they were measured.
    """
    if form == "slurm":
        _write_script(Path(what), folder, overwrite=overwrite)
        return
    from aatri.cli.plan_table import warn_if_stale
    from aatri.formats.registry.export import written_format

    written_format(form, OTHERS)
    path, stage = split_stage(what)
    run = find_run(path)
    name = run.stage(stage)["stage"] if stage else _last_solution(run)
    kind = _record(run, name)["output"]["kind"]
    warn_if_stale(path, [name])
    check_folder(folder, overwrite=overwrite)
    if form == "tables" and kind != "Block":
        _write_tables(run, name, folder)
        narrate(f"{name} of {run.folder} written as {form}")
        say(str(folder))
        return
    options = {"columns": columns, "angle": angle, "rotation": rotation, "lens_misfit_px": lens_misfit}
    oriented = _oriented(run, name, form, measured=measured)
    write_format(form, oriented, folder, options, what=f"{name} of {run.folder}")


def _write_script(run: Path, path: Path, *, overwrite: bool) -> None:
    from aatri.cli.arguments.planning import open_run

    opened = open_run(run)
    if (path.exists() and not overwrite) or path.is_symlink():
        raise SpecError("is there already", where=str(path), remedy="another file, or --overwrite")
    try:
        path.write_text(slurm_script(opened), encoding="utf-8")
        path.chmod(0o755)
    except OSError as error:
        raise ResourceError(f"cannot write: {error.strerror}", where=str(path)) from error
    narrate("submits every stage as a job; arguments go to sbatch")
    say(str(path))


def _write_tables(run: LocatedRun, name: str, folder: Path) -> None:
    """A Solution or an Evaluation as tables."""
    from aatri.pipeline.store import run_folder as store

    kind = _record(run, name)["output"]["kind"]
    if kind == "Solution":
        from aatri.artifacts.solution import Solution
        from aatri.formats.results.solution_tables import write_solution_tables

        source = _record(run, name)["inputs"]["block"]["stage"]
        write_solution_tables(store.load(run.folder, name, Solution), _block(run, source), folder)
    elif kind == "Evaluation":
        from aatri.artifacts.evaluation import Evaluation
        from aatri.formats.results.solution_tables import write_evaluation_tables

        write_evaluation_tables(store.load(run.folder, name, Evaluation), folder)
    else:
        raise SpecError(
            f"{name} gives {kind}; a Solution, a Block or an Evaluation can be exported", where=str(run.folder)
        )


def _oriented(run: LocatedRun, name: str, form: str, *, measured: bool) -> OrientedBlock:
    """A Block, or a Solution with the image points it was made from, as writers take it."""
    from aatri.artifacts.image_points import ImagePoints
    from aatri.artifacts.solution import Solution
    from aatri.formats.results.oriented_block import OrientedBlock
    from aatri.pipeline.store import run_folder as store

    record = _record(run, name)
    kind = record["output"]["kind"]
    inputs = {port: source["stage"] for port, source in record["inputs"].items()}
    if kind == "Block":
        return OrientedBlock(_block(run, name))
    if kind != "Solution":
        raise SpecError(f"{name} gives {kind}; a Solution or a Block can be written as {form}", where=str(run.folder))
    corrected = "image_points" in inputs and not measured
    points = store.load(run.folder, inputs["image_points"], ImagePoints) if corrected else None
    return OrientedBlock(_block(run, inputs["block"]), store.load(run.folder, name, Solution), points)


def _block(run: LocatedRun, name: str) -> Block:
    from aatri.artifacts.block import Block
    from aatri.pipeline.store import run_folder as store

    return store.load(run.folder, name, Block)


def _record(run: LocatedRun, name: str) -> dict[str, Any]:
    from aatri.pipeline.store import run_folder as store

    record = store.current_record(run.folder, name)
    if record is None:
        raise ArtifactError(f"stage {name} has no result", where=str(run.folder), remedy="aatri run")
    return record


def _last_solution(run: LocatedRun) -> str:
    from aatri.pipeline.store import run_folder as store

    for entry in reversed(run.stages):
        record = store.current_record(run.folder, entry["stage"])
        if record is not None and record["output"]["kind"] == "Solution":
            return str(entry["stage"])
    raise ArtifactError("no stage with a Solution", where=str(run.folder), remedy="aatri run")


def slurm_script(opened: Opened) -> str:
    """The text of the script: a job per stage, after those above it; the last makes results current and the report."""
    arguments = arguments_of(opened.request.plain() | {"into": opened.request.into})
    # within a comment a name must not begin a line of its own
    lines = [
        _HEAD.format(pipeline=printable(str(opened.spec.path)), name="SCRIPT", folder=shlex.quote(str(Path.cwd())))
    ]
    for node in opened.nodes:
        after = ":".join(f"$job_{source}" for source in dict.fromkeys(node.inputs.values()))
        command = shlex.join(["aatri", "exec", opened.request.pipeline, node.name, *arguments])
        lines.append(f'job_{node.name}=$(submit {node.name} "{after}" {shlex.quote(command)})\n')
    after = ":".join(f"$job_{node.name}" for node in opened.nodes)
    command = shlex.join(["aatri", "run", opened.request.pipeline, *arguments])
    lines.append(f'job_report=$(submit report "{after}" {shlex.quote(command)})\n')
    lines.append('echo "$job_report"\n')
    return "".join(lines)
