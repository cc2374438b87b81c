"""Run folder: which result of every stage is the current one, and what failed.

    RUN/run.json                                  the pipeline as run: stages in order, status
    RUN/events.jsonl                              what happened, one JSON line each
    RUN/objects/STAGE/KEY/                        results, see `objects`
    RUN/current/STAGE.json, STAGE.h5              the record, and a link to the artifact, of the current result
    RUN/previous/STAGE.json                       the record of the last result, where it is current no more
    RUN/failed/STAGE/error.json, stage.log        why a stage failed; up to three earlier attempts in `earlier/`
    RUN/running/STAGE.log, STAGE.json             the stage under way
    RUN/checkpoints/STAGE/KEY/                    how far a long stage has come
    RUN/items/STAGE/KEY.h5                        results of single images and pairs, see `run.items`

A stage that is to be made again loses its place in `current` before it starts, so that no stale result is shown.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from aatri.errors import ArtifactError, SpecError
from aatri.pipeline.store import inside
from aatri.pipeline.store.cache import file_sha256
from aatri.pipeline.store.inside import on_disk
from aatri.pipeline.store.inside import write_json as write_json
from aatri.pipeline.store.objects import OBJECTS, artifact_file, artifact_of, base_of, load_object
from aatri.pipeline.store.records import read_failure, read_record
from aatri.pipeline.store.records import read_overview as read_overview

if TYPE_CHECKING:
    from aatri.tables.schema import Artifact

A = TypeVar("A", bound="Artifact")

KEPT_ATTEMPTS = 3
_FOLDERS = ("current", "previous", "failed", "running")
_FILES = (".lock", "run.json", "events.jsonl", "report.html")
_NAMES = {*_FOLDERS, *_FILES, "objects", "variants", "checkpoints", "items", "accepted"}


def begin(run: Path, overview: Mapping[str, Any]) -> None:
    """Open a run: make its folders, and remove what dead processes left half-written.

    Raises
    ------
    SpecError
        If the folder holds other things than a run.
    ResourceError
        If it cannot be written.
    """
    prepare(run)
    with on_disk(run):
        for folder in {run, base_of(run)}:
            inside.sweep(folder)
        write_json(dict(overview), run, "run.json")


def prepare(run: Path) -> None:
    """Make the folders of a run."""
    with on_disk(run):
        for name in _FOLDERS:
            inside.make_folder(run, name)
        inside.make_folder(base_of(run), OBJECTS)


def claim(run: Path, variant: str) -> None:
    """See that a folder may be written to; the run of a variant gets the store of the run that it belongs to.

    Raises
    ------
    SpecError
        If the folder holds other things than a run.
    """
    check_is_run(run)
    if variant:
        owner = run.parent.parent
        check_is_run(owner)
        with on_disk(owner):
            inside.make_folder(owner, OBJECTS)
            inside.make_folder(run)


def check_is_run(run: Path) -> None:
    """Refuse to write into a folder of other things.

    Raises
    ------
    SpecError
        If the folder is neither empty nor one of a run.
    """
    if run.exists() and not (run / "run.json").is_file():
        names = {p.name for p in run.iterdir() if not p.name.startswith(".tmp-")} if run.is_dir() else {"a file"}
        if names <= _NAMES and (".lock" in names or names <= {"objects", "variants"}):
            return  # empty, or ended before run.json was there
        raise SpecError("exists and is not the folder of a run", where=str(run), remedy="choose another, or empty it")


def withdraw(run: Path, stages: Iterable[str]) -> None:
    """Take stages out of `current`; their last records are kept in `previous`."""
    with on_disk(run):
        for stage in stages:
            if inside.kind(run, "current", f"{stage}.json"):
                inside.move(run, ("current", f"{stage}.json"), ("previous", f"{stage}.json"))
            inside.remove(run, "current", f"{stage}.h5")
            _set_aside(run, stage)


def make_current(run: Path, record: Mapping[str, Any]) -> None:
    """Let the result of a record be the current one of its stage."""
    stage = record["stage"]
    with on_disk(run / "current"):
        inside.make_folder(run, "current")
        _set_aside(run, stage)
        _link(artifact_file(run, record), inside.path_of(run, "current", f"{stage}.h5"))
        write_json(dict(record), run, "current", f"{stage}.json")
        inside.remove(run, "previous", f"{stage}.json")


def is_current(run: Path, record: Mapping[str, Any]) -> bool:
    """Whether the result of a record is the current one of its stage, in record and link."""
    stage = record["stage"]
    try:
        current = current_record(run, stage)
        link, target = inside.path_of(run, "current", f"{stage}.h5"), artifact_file(run, record)
        return current == record and _leads_to(link, target) and failure(run, stage) is None
    except (ArtifactError, FileNotFoundError):
        return False


def fail(run: Path, stage: str, error: Mapping[str, Any]) -> Path:
    """Keep the log and the diagnostics of a stage that failed; returns their folder."""
    with on_disk(run / "failed"):
        _set_aside(run, stage)
        folder = inside.make_folder(run, "failed", stage)
        if inside.kind(run, "running", f"{stage}.log") == "file":
            inside.move(run, ("running", f"{stage}.log"), ("failed", stage, "stage.log"))
        write_json({"schema": 1, "stage": stage, **error}, run, "failed", stage, "error.json")
    return folder


def current_record(run: Path, stage: str) -> dict[str, Any] | None:
    """Record of the current result of a stage; None if there is none."""
    return _own_record(run, "current", stage)


def existing_record(run: Path, stage: str) -> dict[str, Any]:
    """Record of the current result of a stage, which should be there.

    Raises
    ------
    ArtifactError
        If there is none.
    """
    record = current_record(run, stage)
    if record is None:
        raise ArtifactError(f"stage {stage} has no result", where=str(run), remedy="aatri run")
    return record


def last_record(run: Path, stage: str) -> dict[str, Any] | None:
    """Record of the last result of a stage, current or not; None if there is none that can be read."""
    for folder in ("current", "previous"):
        with contextlib.suppress(ArtifactError):
            record = _own_record(run, folder, stage)
            if record is not None:
                return record
    return None


def _own_record(run: Path, folder: str, stage: str) -> dict[str, Any] | None:
    record = read_record(run, folder, f"{stage}.json")
    if record is not None and record["stage"] != stage:
        raise ArtifactError(
            f"the record of another stage, {record['stage']}",
            where=str(inside.path_of(run, folder, f"{stage}.json")),
            remedy="aatri run",
        )
    return record


failure = read_failure


def artifact_path(run: Path, stage: str) -> Path:
    """File of the current result of a stage.

    Raises
    ------
    ArtifactError
        If there is none.
    """
    return artifact_of(run, existing_record(run, stage))


def load(run: Path, stage: str, kind: type[A], in_memory: Mapping[str, Artifact] = {}) -> A:
    """The current artifact of a stage, its file checked against the record; what is `in_memory` is not read.

    Raises
    ------
    ArtifactError
        If there is none, or the file is not the one that was written.
    """
    return load_object(run, existing_record(run, stage), kind, in_memory)


def _set_aside(run: Path, stage: str) -> None:
    """Put the last failure of a stage among its earlier ones, of which the latest are kept."""
    at = ("failed", stage)
    if not inside.kind(run, *at, "error.json"):
        return
    earlier = (*at, "earlier", f"{time.time_ns():020d}")
    inside.make_folder(run, *earlier)
    for name in ("stage.log", "error.json"):
        if inside.kind(run, *at, name):
            inside.move(run, (*at, name), (*earlier, name))
    for old in inside.names_in(run, *at, "earlier")[:-KEPT_ATTEMPTS]:
        inside.remove_folder(run, *at, "earlier", old)


def _leads_to(link: Path, target: Path) -> bool:
    """Whether a name made by `_link` still leads to its file; what someone put in its place does not."""
    try:
        return link.samefile(target) or (not link.is_symlink() and file_sha256(link) == file_sha256(target))
    except OSError:
        return False


def _link(source: Path, link: Path) -> None:
    """Lead a name to a file: a link, or where that is impossible a copy."""
    temporary = inside.temporary_name(link)
    try:
        temporary.symlink_to(os.path.relpath(source, link.parent))
    except (OSError, NotImplementedError):  # no symbolic links here, as on Windows without the right
        try:
            os.link(source, temporary)
        except OSError:
            shutil.copyfile(source, temporary)
    temporary.replace(link)
