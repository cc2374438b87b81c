"""Results in the store, by key: an artifact, its log, and its record, which is written last and makes it exist.

    RUN/objects/STAGE/KEY/artifact.h5, stage.log, record.json

A record says what the artifact was made of and by what, and its SHA-256; it bears a seal, the SHA-256 of its own
content, so that an altered record is noticed too. The runs of variants keep their results in the store of the run that
they belong to (`RUN/variants/NAME`), so that what is equal is made once.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from aatri.errors import ArtifactError
from aatri.pipeline.store.cache import file_sha256
from aatri.pipeline.store.durable import on_disk, read_json, sync, temporary_name, write_json

if TYPE_CHECKING:
    from aatri.tables.schema import Artifact

A = TypeVar("A", bound="Artifact")

SCHEMA = 2
VARIANTS = "variants"


def base_of(run: Path) -> Path:
    """The run that holds the store: the run itself, or the one that it is a variant of."""
    owner = run.parent.parent
    return owner if run.parent.name == VARIANTS and (owner / "objects").is_dir() else run


def object_folder(run: Path, stage: str, key: str) -> Path:
    """Folder of one result of a stage."""
    return base_of(run) / "objects" / stage / key


def commit_object(
    run: Path, stage: str, key: str, artifact: Artifact, record: Mapping[str, Any], log: Path | None = None
) -> dict[str, Any]:
    """Bring an artifact and its record to the disk.

    Returns
    -------
    dict
        The record with its `output` and `seal`.

    Raises
    ------
    ResourceError
        If the disk is full or writing is not allowed; then there is no artifact.
    """
    from aatri.tables import hdf5

    folder = object_folder(run, stage, key)
    final = folder / "artifact.h5"
    with on_disk(folder):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "record.json").unlink(missing_ok=True)
        temporary = temporary_name(final)
        try:
            content_digest = hdf5.write(artifact, temporary, record.get("warnings", ()))
            sync(temporary)
            sha256, size = file_sha256(temporary), temporary.stat().st_size
            temporary.replace(final)
            sync(folder)
        finally:
            temporary.unlink(missing_ok=True)
        output = {"kind": artifact.kind, "file": final.name, "sha256": sha256, "size": size,
                  "content_digest": content_digest}  # fmt: skip
        if log is not None and log.exists():
            log.replace(folder / "stage.log")
        full = {"schema": SCHEMA, "stage": stage, "key": key, **record, "output": output}
        full["seal"] = seal(full)
        write_json(folder / "record.json", full)
        sync(folder.parent)
    return full


def read_record(path: Path) -> dict[str, Any] | None:
    """A record; None if there is none.

    Raises
    ------
    ArtifactError
        If it is damaged or was altered.
    """
    record = read_json(path)
    if record is not None and record.get("schema") == SCHEMA and record.get("seal") != seal(record):
        raise ArtifactError("the record was altered", where=str(path), remedy="aatri run makes the result again")
    return record


def object_record(run: Path, stage: str, key: str) -> dict[str, Any] | None:
    """Record of a result; None if there is none, or it is not the record of this result."""
    record = read_record(object_folder(run, stage, key) / "record.json")
    if record is None or record.get("schema") != SCHEMA or (record["stage"], record["key"]) != (stage, key):
        return None
    return record


def records_of(run: Path, stage: str) -> Iterator[dict[str, Any]]:
    """The readable records of all results of a stage."""
    folder = base_of(run) / "objects" / stage
    for place in sorted(folder.iterdir()) if folder.is_dir() else ():
        try:
            record = object_record(run, stage, place.name)
        except ArtifactError:
            continue
        if record is not None:
            yield record


def artifact_file(run: Path, record: Mapping[str, Any]) -> Path:
    """File of the artifact of a record."""
    return object_folder(run, record["stage"], record["key"]) / str(record["output"]["file"])


def load_object(run: Path, record: Mapping[str, Any], kind: type[A]) -> A:
    """The artifact of a record, its file checked against it.

    Raises
    ------
    ArtifactError
        If it is gone, or the file is not the one that was written.
    """
    from aatri.tables import hdf5

    path = artifact_file(run, record)
    if not path.is_file():
        raise ArtifactError("the artifact of the record is gone", where=str(path), remedy="aatri run")
    if file_sha256(path) != record["output"]["sha256"]:
        raise ArtifactError("altered since it was written: its SHA-256 is not that of its record", where=str(path),
                            remedy="aatri run makes it again")  # fmt: skip
    return hdf5.read(path, kind)


def seal(record: Mapping[str, Any]) -> str:
    """SHA-256 of the content of a record."""
    content = {name: value for name, value in record.items() if name != "seal"}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()
