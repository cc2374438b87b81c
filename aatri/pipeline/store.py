"""Run folder: where artifacts and their records lie, and how they come to exist.

    RUN/run.json                                  the pipeline as run: stages in order, status
    RUN/objects/STAGE/KEY/artifact.h5             the artifact
                          record.json             written last: only this makes the artifact exist
                          stage.log
    RUN/current/STAGE.json, STAGE.h5              the record, and a link to the artifact, of the latest result
    RUN/failed/STAGE/error.json, stage.log        why a stage failed
    RUN/running/STAGE.log                         the log of the stage under way

A file appears under a temporary name in its folder, is closed, read back, brought to the disk (fsync), renamed, and
its folder brought to the disk. A crash at any moment leaves the old state or the new one.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import secrets
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

from aatri.errors import ArtifactError, ResourceError, SpecError
from aatri.tables.schema import Artifact

A = TypeVar("A", bound=Artifact)

SCHEMA = 1


def object_folder(run: Path, stage: str, key: str) -> Path:
    """Folder of one result of a stage."""
    return run / "objects" / stage / key


def begin(run: Path, overview: Mapping[str, Any]) -> None:
    """Open a run: nothing is current until it has been made again, so that no stale result is shown.

    Raises
    ------
    SpecError
        If the folder holds other things than a run.
    ResourceError
        If it cannot be written.
    """
    if run.exists() and not (run / "run.json").is_file() and (not run.is_dir() or any(run.iterdir())):
        raise SpecError("exists and is not the folder of a run", where=str(run), remedy="choose another, or empty it")
    with _on_disk(run):
        for folder in ("current", "failed", "running"):
            shutil.rmtree(run / folder, ignore_errors=True)
            (run / folder).mkdir(parents=True, exist_ok=True)
        write_json(run / "run.json", {"schema": SCHEMA, **overview})


def commit(run: Path, stage: str, key: str, artifact: Artifact, record: Mapping[str, Any]) -> dict[str, Any]:
    """Bring an artifact and its record to the disk and make it the current one.

    Returns
    -------
    dict
        The record with its `output`.

    Raises
    ------
    ResourceError
        If the disk is full or writing is not allowed; then there is no artifact.
    """
    from aatri.tables import hdf5

    folder = object_folder(run, stage, key)
    final = folder / "artifact.h5"
    with _on_disk(folder):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "record.json").unlink(missing_ok=True)
        temporary = _temporary(final)
        try:
            content_digest = hdf5.write(artifact, temporary)
            _sync(temporary)
            sha256, size = file_digest(temporary), temporary.stat().st_size
            temporary.replace(final)
            _sync(folder)
        finally:
            temporary.unlink(missing_ok=True)
        output = {"kind": artifact.kind, "file": final.name, "sha256": sha256, "size": size,
                  "content_digest": content_digest}  # fmt: skip
        log = run / "running" / f"{stage}.log"
        if log.exists():
            log.replace(folder / "stage.log")
        full = {"schema": SCHEMA, "stage": stage, "key": key, **record, "output": output}
        write_json(folder / "record.json", full)
        _make_current(run, stage, key, full)
    return full


def fail(run: Path, stage: str, error: Mapping[str, Any]) -> Path:
    """Keep the log and the diagnostics of a stage that failed; returns their folder."""
    folder = run / "failed" / stage
    with _on_disk(folder):
        folder.mkdir(parents=True, exist_ok=True)
        log = run / "running" / f"{stage}.log"
        if log.exists():
            log.replace(folder / "stage.log")
        write_json(folder / "error.json", {"schema": SCHEMA, "stage": stage, **error})
    return folder


def current_record(run: Path, stage: str) -> dict[str, Any] | None:
    """Record of the current result of a stage; None if there is none."""
    return read_json(run / "current" / f"{stage}.json")


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
    return object_folder(run, stage, record["key"]) / str(record["output"]["file"])


def load(run: Path, stage: str, kind: type[A]) -> A:
    """The current artifact of a stage, its file checked against the record.

    Raises
    ------
    ArtifactError
        If there is none, or the file is not the one that was written.
    """
    from aatri.tables import hdf5

    path = artifact_path(run, stage)
    record = current_record(run, stage) or {}
    if not path.is_file():
        raise ArtifactError("the artifact of the record is gone", where=str(path), remedy="aatri run")
    if file_digest(path) != record["output"]["sha256"]:
        raise ArtifactError("altered since it was written: its SHA-256 is not that of its record", where=str(path),
                            remedy="aatri run makes it again")  # fmt: skip
    return hdf5.read(path, kind)


def file_digest(path: Path) -> str:
    """Hex SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write_json(path: Path, value: Any) -> None:
    """Write a JSON file atomically."""
    text = json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    temporary = _temporary(path)
    try:
        temporary.write_text(text, encoding="utf-8")
        _sync(temporary)
        temporary.replace(path)
        _sync(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


def read_json(path: Path) -> dict[str, Any] | None:
    """A JSON file of the store; None if there is none.

    Raises
    ------
    ArtifactError
        If it is damaged.
    """
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (OSError, ValueError) as error:
        raise ArtifactError(f"not readable: {error}", where=str(path), remedy="aatri run writes it again") from error
    if not isinstance(value, dict):
        raise ArtifactError("not a record", where=str(path), remedy="aatri run writes it again")
    return value


def _make_current(run: Path, stage: str, key: str, record: Mapping[str, Any]) -> None:
    folder = run / "current"
    folder.mkdir(parents=True, exist_ok=True)
    shutil.rmtree(run / "failed" / stage, ignore_errors=True)
    link = folder / f"{stage}.h5"
    temporary = _temporary(link)
    target = Path("..") / "objects" / stage / key / "artifact.h5"
    try:
        temporary.symlink_to(target)
    except (OSError, NotImplementedError):  # no symbolic links here, as on Windows without the right
        _link_or_copy(folder / target, temporary)
    temporary.replace(link)
    write_json(folder / f"{stage}.json", record)


def _link_or_copy(source: Path, target: Path) -> None:
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)


def _temporary(path: Path) -> Path:
    return path.with_name(f".tmp-{path.stem}-{os.getpid()}-{secrets.token_hex(4)}{path.suffix}")


def _sync(path: Path) -> None:
    """Bring a file or folder to the disk; some systems cannot open a folder for that."""
    try:
        handle = os.open(path, os.O_RDONLY)
    except PermissionError:
        if path.is_dir():
            return
        raise
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextlib.contextmanager
def _on_disk(where: Path) -> Iterator[None]:
    """Turn the operating system's errors into ours."""
    try:
        yield
    except (ArtifactError, ResourceError):
        raise
    except OSError as error:
        raise ResourceError(f"cannot write: {error.strerror or error}", where=str(error.filename or where),
                            remedy="free space, check the permission, or use --into DIR") from error  # fmt: skip
