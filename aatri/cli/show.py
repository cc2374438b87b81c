"""`aatri show`: what an artifact holds and where it comes from."""

import math
from pathlib import Path
from typing import Annotated, Any

import typer

from aatri.cli.arguments.completion import complete_run_stage, complete_table
from aatri.cli.arguments.locate import find_run, split_stage
from aatri.cli.arguments.options import AsJson
from aatri.cli.terminal.console import narrate, reports_errors, say, say_json, say_table
from aatri.errors import AatriError, ArtifactError, SpecError
from aatri.ids import several

MOST_ROWS = 20
"""Rows of a table that are printed unless all are asked for."""


@reports_errors
def show(
    what: Annotated[
        str,
        typer.Argument(
            metavar="RUN:STAGE|FILE.h5", autocompletion=complete_run_stage, help="`:STAGE` means the default run."
        ),
    ],
    table: Annotated[
        str,
        typer.Argument(
            metavar="[TABLE]", autocompletion=complete_table, help="Print its values: suspects, residuals ..."
        ),
    ] = "",
    json: AsJson = False,
    all_rows: Annotated[bool, typer.Option("--all", help="All rows of the table, not the first 20.")] = False,
) -> None:
    """Show what an artifact holds and where it comes from, or the values of one of its tables."""
    from aatri.cli.terminal.show_values import cell
    from aatri.tables.hdf5 import read_header

    path = _file(what)
    header = read_header(path)
    if table:
        from aatri.cli.terminal.show_values import say_values

        say_values(path, str(header["kind"]), table, None if all_rows else MOST_ROWS, json=json)
        return
    record = _record(path)
    if json:
        header["attributes"] = {name: _finite(value) for name, value in header["attributes"].items()}
        say_json({"file": str(path), **header, "record": record})
        return
    say(f"{header['kind']}  {path}")
    say()
    attributes = [[name, cell(_finite(value))] for name, value in header["attributes"].items()]
    say_table(("attribute", "value"), attributes)
    for name, contents in header["tables"].items():
        say()
        say(f"{name}: {several(contents['rows'], 'row')}. {contents['description']}")
        rows = [
            [f"  {n}", "x".join(map(str, c["shape"])), c["units"], c["description"]]
            for n, c in contents["columns"].items()
        ]
        say_table(("  column", "shape", "unit", "description"), rows)
    say()
    _say_provenance(record)
    if record is None:
        _say_warnings(path)


def _file(what: str) -> Path:
    from aatri.cli.plan_table import warn_if_stale
    from aatri.pipeline.store import run_folder as store

    if what.endswith(".h5"):
        return Path(what)
    path, stage = split_stage(what)
    if stage is None:
        raise _without_stage(what, path)
    run = find_run(path)
    run.stage(stage)
    artifact = store.artifact_path(run.folder, stage)
    warn_if_stale(path, [stage])
    return artifact


def _without_stage(what: str, path: Path | None) -> SpecError:
    """Of a word without a colon: the stages that there are in the run of that name, or in the one at hand."""
    for run in (path, None):
        try:
            names = [entry["stage"] for entry in find_run(run).stages]
        except (AatriError, OSError):
            continue
        of_run = "" if run is None else f"{run}"
        if what in names:
            return SpecError(f"{what}: no run of that name, but a stage", remedy=f"aatri show :{what}")
        return SpecError(f"{what}: no stage named", remedy="one of " + ", ".join(f"{of_run}:{name}" for name in names))
    return SpecError(f"{what}: no stage named", remedy="RUN:STAGE, :STAGE or FILE.h5; `aatri status` lists the stages")


def _record(path: Path) -> dict[str, Any] | None:
    """The record beside the artifact: in its object folder, or beside the link in `current`."""
    from aatri.pipeline.store.records import read_record

    places = [(path.resolve().parent, "record.json")]
    if path.parent.name == "current":
        places.append((path.parent, f"{path.stem}.json"))
    for folder, name in places:
        try:
            record = read_record(folder, name)
        except ArtifactError as error:
            narrate(f"warning: {error}")
            continue
        if record is not None:
            return record
    return None


def _say_warnings(path: Path) -> None:
    """The warnings that the file itself holds, wherever it was copied to."""
    from aatri.tables.hdf5 import read_warnings

    for text in read_warnings(path):
        say(f"warning  {text}")


def _finite(value: Any) -> Any:
    """JSON has no NaN: what is not given is null."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _say_provenance(record: dict[str, Any] | None) -> None:
    if record is None:
        say("no record beside the file: its origin is not known")
        return
    inputs = [
        f"{port} = {source['stage']} ({source['content_digest'][:12]})" for port, source in record["inputs"].items()
    ]
    options = [f"{name} = {value}" for name, value in record["options"].items()]
    rows = [
        ["made by", f"{record['plugin']} version {record['version']}, stage {record['stage']}, key {record['key']}"],
        ["from", ", ".join(inputs) or "nothing"],
        ["options", ", ".join(options) or "none"],
        ["content digest", record["output"]["content_digest"]],
        ["SHA-256 of the file", record["output"]["sha256"]],
        ["time", f"{record['started']} to {record['ended']}, {record['seconds']} s"],
        ["with", ", ".join(f"{name} {value}" for name, value in record["environment"].items())],
        *[["warning", text] for text in record["warnings"]],
    ]
    say_table(("provenance", ""), rows)
