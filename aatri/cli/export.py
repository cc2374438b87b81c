"""`aatri export`: artifacts as tables or models of other programs, a pipeline as a script for SLURM."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aatri.cli.arguments.choice import complete, listed, one_of
from aatri.cli.arguments.completion import complete_run_stage
from aatri.cli.arguments.locate import LocatedRun, find_run, split_stage
from aatri.cli.terminal.console import narrate, reports_errors, say
from aatri.errors import ArtifactError, ResourceError, SpecError

if TYPE_CHECKING:
    from aatri.artifacts.block import Block


class ExportForm(StrEnum):
    """Forms that artifacts can be exported to."""

    tables = "tables"
    colmap = "colmap"
    bal = "bal"
    slurm = "slurm"
    wucaps = "wucaps"


@reports_errors
def export(
    what: Annotated[
        str,
        typer.Argument(
            metavar="RUN[:STAGE]", autocompletion=complete_run_stage, help="Without STAGE the last Solution."
        ),
    ],
    form: Annotated[
        ExportForm,
        typer.Argument(
            parser=one_of(ExportForm),
            autocompletion=complete(ExportForm),
            metavar="FORM",
            help=f"One of {listed(ExportForm)}.",
        ),
    ],
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder to write to; for slurm a file.")],
    overwrite: Annotated[bool, typer.Option(help="Write into a folder that is not empty.")] = False,
) -> None:
    """Export results as tables or WuCAPS files, a Solution for COLMAP or BAL, a pipeline for SLURM."""
    if form is ExportForm.slurm:
        _write_script(Path(what), folder, overwrite=overwrite)
        return
    path, stage = split_stage(what)
    run = find_run(path)
    name = run.stage(stage)["stage"] if stage else _last_solution(run)
    if folder.exists() and not folder.is_dir():
        raise SpecError("not a folder", where=str(folder))
    if folder.is_dir() and any(folder.iterdir()) and not overwrite:
        raise SpecError("the folder is not empty", where=str(folder), remedy="another folder, or --overwrite")
    _refuse_links(folder)
    if form is ExportForm.tables:
        _write(run, name, folder)
    elif form is ExportForm.wucaps:
        _write_wucaps(run, name, folder)
    else:
        _write_model(run, name, form, folder)
    narrate(f"{name} of {run.folder} written as {form}")
    say(str(folder))


def _refuse_links(folder: Path) -> None:
    """Writing over a link would change a file elsewhere; over a pipe it would wait for a reader."""
    for path in sorted(folder.iterdir()) if folder.is_dir() else ():
        if path.is_symlink() or not (path.is_file() or path.is_dir()):
            raise SpecError(
                "is a link or no file, and would be written through",
                where=str(path),
                remedy="remove it, or another folder",
            )


def _write_script(run: Path, path: Path, *, overwrite: bool) -> None:
    from aatri.cli.arguments.planning import open_run
    from aatri.cli.slurm import script

    opened = open_run(run)
    if (path.exists() and not overwrite) or path.is_symlink():
        raise SpecError("is there already", where=str(path), remedy="another file, or --overwrite")
    try:
        path.write_text(script(opened), encoding="utf-8")
        path.chmod(0o755)
    except OSError as error:
        raise ResourceError(f"cannot write: {error.strerror}", where=str(path)) from error
    narrate("submits every stage as a job; arguments go to sbatch")
    say(str(path))


def _write(run: LocatedRun, name: str, folder: Path) -> None:
    kind = _record(run, name)["output"]["kind"]
    if kind == "Block":
        from aatri.formats.tables.writer import write_block

        write_block(_block(run, name), folder)
    elif kind == "Solution":
        from aatri.artifacts.solution import Solution
        from aatri.formats.results.solution_tables import write_solution_tables
        from aatri.pipeline.store import run_folder as store

        source = _record(run, name)["inputs"]["block"]["stage"]
        write_solution_tables(store.load(run.folder, name, Solution), _block(run, source), folder)
    elif kind == "Evaluation":
        from aatri.artifacts.evaluation import Evaluation
        from aatri.formats.results.solution_tables import write_evaluation_tables
        from aatri.pipeline.store import run_folder as store

        write_evaluation_tables(store.load(run.folder, name, Evaluation), folder)
    else:
        raise SpecError(
            f"{name} gives {kind}; a Solution, a Block or an Evaluation can be exported", where=str(run.folder)
        )


def _write_model(run: LocatedRun, name: str, form: ExportForm, folder: Path) -> None:
    """A Solution as another program reads it, with the image points it was made from."""
    from aatri.artifacts.image_points import ImagePoints
    from aatri.artifacts.solution import Solution
    from aatri.formats.results.crs import write_crs
    from aatri.pipeline.store import run_folder as store

    record = _record(run, name)
    if record["output"]["kind"] != "Solution":
        raise SpecError(
            f"{name} gives {record['output']['kind']}; only a Solution can be written as {form}", where=str(run.folder)
        )
    inputs = {port: source["stage"] for port, source in record["inputs"].items()}
    solution, block = store.load(run.folder, name, Solution), _block(run, inputs["block"])
    points = store.load(run.folder, inputs["image_points"], ImagePoints) if "image_points" in inputs else None
    if form is ExportForm.colmap:
        from aatri.formats.colmap.writer import write_colmap_model

        write_colmap_model(solution, block, folder, image_points=points)
    else:
        from aatri.formats.bal.writer import write_bal_problem

        write_bal_problem(solution, block, folder / "problem.txt", image_points=points)
    write_crs(block, folder)


def _write_wucaps(run: LocatedRun, name: str, folder: Path) -> None:
    """A Block as measured, or that of a Solution with the image points it was made from."""
    from aatri.artifacts.image_points import ImagePoints
    from aatri.formats.wucaps.writer import write_wucaps
    from aatri.pipeline.store import run_folder as store

    record = _record(run, name)
    inputs = {port: source["stage"] for port, source in record["inputs"].items()}
    if record["output"]["kind"] not in ("Block", "Solution"):
        raise SpecError(
            f"{name} gives {record['output']['kind']}; a Solution or a Block can be exported", where=str(run.folder)
        )
    points = store.load(run.folder, inputs["image_points"], ImagePoints) if "image_points" in inputs else None
    for note in write_wucaps(_block(run, inputs.get("block", name)), folder, points):
        narrate(f"{note.level}: {note}")


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
