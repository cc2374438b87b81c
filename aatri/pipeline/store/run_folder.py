"""Run folder: which result of every stage is the current one, and what failed.

    RUN/run.json                                  the pipeline as run: stages in order, status
    RUN/events.jsonl                              what happened, one JSON line each
    RUN/objects/STAGE/KEY/                        results, see `objects`
    RUN/current/STAGE.json, STAGE.h5              the record, and a link to the artifact, of the current result
    RUN/previous/STAGE.json                       the record of the last result, where it is current no more
    RUN/failed/STAGE/error.json, stage.log        why a stage failed; up to three earlier attempts in `earlier/`
    RUN/running/STAGE.log, STAGE.json             the stage under way
    RUN/checkpoints/STAGE/KEY/                    how far a long stage has come

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
from aatri.pipeline.store.cache import file_sha256
from aatri.pipeline.store.durable import on_disk, read_json, sweep, temporary_name, write_json
from aatri.pipeline.store.objects import artifact_file, base_of, commit_object, load_object, object_folder, read_record

if TYPE_CHECKING:
    from aatri.tables.schema import Artifact

A = TypeVar("A", bound="Artifact")

KEPT_ATTEMPTS = 3
_FOLDERS = ("current", "previous", "failed", "running")


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
            sweep(folder)
        write_json(run / "run.json", dict(overview))


def prepare(run: Path) -> None:
    """Make the folders of a run."""
    with on_disk(run):
        for name in _FOLDERS:
            (run / name).mkdir(parents=True, exist_ok=True)
        (base_of(run) / "objects").mkdir(exist_ok=True)


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
            (owner / "objects").mkdir(parents=True, exist_ok=True)


def check_is_run(run: Path) -> None:
    """Refuse to write into a folder of other things.

    Raises
    ------
    SpecError
        If the folder is neither empty nor one of a run.
    """
    known = {".lock", "run.json", "events.jsonl", "objects", "variants", "checkpoints", *_FOLDERS}
    if run.exists() and not (run / "run.json").is_file():
        names = {p.name for p in run.iterdir() if not p.name.startswith(".tmp-")} if run.is_dir() else {"a file"}
        if names <= known and (".lock" in names or names <= {"objects", "variants"}):
            return  # empty, or ended before run.json was there
        raise SpecError("exists and is not the folder of a run", where=str(run), remedy="choose another, or empty it")


def withdraw(run: Path, stages: Iterable[str]) -> None:
    """Take stages out of `current`; their last records are kept in `previous`."""
    with on_disk(run):
        for stage in stages:
            record = run / "current" / f"{stage}.json"
            if record.exists():
                record.replace(run / "previous" / f"{stage}.json")
            (run / "current" / f"{stage}.h5").unlink(missing_ok=True)
            _set_aside(run, stage)


def make_current(run: Path, record: Mapping[str, Any]) -> None:
    """Let the result of a record be the current one of its stage."""
    stage, folder = record["stage"], run / "current"
    with on_disk(folder):
        folder.mkdir(parents=True, exist_ok=True)
        _set_aside(run, stage)
        _link(artifact_file(run, record), folder / f"{stage}.h5")
        write_json(folder / f"{stage}.json", dict(record))
        (run / "previous" / f"{stage}.json").unlink(missing_ok=True)


def is_current(run: Path, record: Mapping[str, Any]) -> bool:
    """Whether the result of a record is the current one of its stage, in record and link."""
    stage = record["stage"]
    link = run / "current" / f"{stage}.h5"
    try:
        current = read_record(run / "current" / f"{stage}.json")
    except ArtifactError:
        return False
    target = artifact_file(run, record)
    return current == record and _leads_to(link, target) and failure(run, stage) is None


def commit(run: Path, stage: str, key: str, artifact: Artifact, record: Mapping[str, Any]) -> dict[str, Any]:
    """Bring an artifact and its record to the disk and make it the current one; returns the record."""
    full = commit_object(run, stage, key, artifact, record, run / "running" / f"{stage}.log")
    make_current(run, full)
    return full


def fail(run: Path, stage: str, error: Mapping[str, Any]) -> Path:
    """Keep the log and the diagnostics of a stage that failed; returns their folder."""
    folder = run / "failed" / stage
    with on_disk(folder):
        _set_aside(run, stage)
        folder.mkdir(parents=True, exist_ok=True)
        log = run / "running" / f"{stage}.log"
        if log.exists():
            log.replace(folder / "stage.log")
        write_json(folder / "error.json", {"schema": 1, "stage": stage, **error})
    return folder


def current_record(run: Path, stage: str) -> dict[str, Any] | None:
    """Record of the current result of a stage; None if there is none."""
    return read_record(run / "current" / f"{stage}.json")


def last_record(run: Path, stage: str) -> dict[str, Any] | None:
    """Record of the last result of a stage, current or not; None if there is none that can be read."""
    for folder in ("current", "previous"):
        with contextlib.suppress(ArtifactError):
            record = read_record(run / folder / f"{stage}.json")
            if record is not None:
                return record
    return None


def failure(run: Path, stage: str) -> dict[str, Any] | None:
    """Why the stage failed; None if it did not."""
    return read_json(run / "failed" / stage / "error.json")


def artifact_path(run: Path, stage: str) -> Path:
    """File of the current result of a stage.

    Raises
    ------
    ArtifactError
        If there is none.
    """
    record = current_record(run, stage)
    if record is None:
        raise ArtifactError(f"stage {stage} has no result", where=str(run), remedy="aatri run")
    return artifact_file(run, record)


def load(run: Path, stage: str, kind: type[A]) -> A:
    """The current artifact of a stage, its file checked against the record.

    Raises
    ------
    ArtifactError
        If there is none, or the file is not the one that was written.
    """
    artifact_path(run, stage)
    return load_object(run, current_record(run, stage) or {}, kind)


def _set_aside(run: Path, stage: str) -> None:
    """Put the last failure of a stage among its earlier ones, of which the latest are kept."""
    folder = run / "failed" / stage
    if not (folder / "error.json").exists():
        return
    earlier = folder / "earlier"
    place = earlier / f"{time.time_ns():020d}"
    place.mkdir(parents=True, exist_ok=True)
    for name in ("stage.log", "error.json"):
        if (folder / name).exists():
            (folder / name).replace(place / name)
    for old in sorted(earlier.iterdir())[:-KEPT_ATTEMPTS]:
        shutil.rmtree(old, ignore_errors=True)


def _leads_to(link: Path, target: Path) -> bool:
    """Whether a name made by `_link` still leads to its file; what someone put in its place does not."""
    try:
        return link.samefile(target) or (not link.is_symlink() and file_sha256(link) == file_sha256(target))
    except OSError:
        return False


def _link(source: Path, link: Path) -> None:
    """Lead a name to a file: a link, or where that is impossible a copy."""
    temporary = temporary_name(link)
    try:
        temporary.symlink_to(os.path.relpath(source, link.parent))
    except (OSError, NotImplementedError):  # no symbolic links here, as on Windows without the right
        try:
            os.link(source, temporary)
        except OSError:
            shutil.copyfile(source, temporary)
    temporary.replace(link)


__all__ = ["artifact_path", "begin", "check_is_run", "commit", "current_record", "fail", "failure", "is_current",
           "last_record", "load", "make_current", "object_folder", "read_json", "withdraw", "write_json"]  # fmt: skip
