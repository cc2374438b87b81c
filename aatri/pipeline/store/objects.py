"""Results in the store, by key: an artifact, its log, and its record, which is written last and makes it exist.

    RUN/objects/STAGE/KEY/artifact.h5, stage.log, record.json

A record says what the artifact was made of and by what, and its SHA-256; it bears a seal, the SHA-256 of its own
content, so that an altered record is noticed too. The runs of variants keep their results in the store of the run that
they belong to (`RUN/variants/NAME`), so that what is equal is made once.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from aatri.errors import ArtifactError
from aatri.pipeline.store import inside
from aatri.pipeline.store.cache import Cache, file_sha256, of_file, put_file
from aatri.pipeline.store.inside import VARIANTS, on_disk, write_json
from aatri.pipeline.store.records import ARTIFACT, SCHEMA, read_record, seal

if TYPE_CHECKING:
    from aatri.tables.schema import Artifact

A = TypeVar("A", bound="Artifact")

OBJECTS, ITEMS, RECORD = "objects", "items", "record.json"

_DIGESTS = Cache(None)
"""Of the files that this process has written or read: one that has not changed since is not read again for it."""


def base_of(run: Path) -> Path:
    """The run that holds the store: the run itself, or the one that it is a variant of."""
    owner = run.parent.parent
    return owner if run.parent.name == VARIANTS and (owner / OBJECTS).is_dir() else run


def commit_object(run: Path, stage: str, key: str, artifact: Artifact, record: Mapping[str, Any]) -> dict[str, Any]:
    """Bring an artifact and its record to the disk, with the log of the stage under way.

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
    from aatri.tables.schema import rows_of

    base, at = base_of(run), (OBJECTS, stage, key)
    clock = time.perf_counter()
    with on_disk(base):
        folder = inside.make_folder(base, *at)
        inside.remove(base, *at, RECORD)
        final = inside.path_of(base, *at, ARTIFACT)
        temporary = inside.temporary_name(final)
        try:
            content_digest = hdf5.put(artifact, temporary, record.get("warnings", ()))
            with ThreadPoolExecutor(1) as hashing:
                digest = hashing.submit(file_sha256, temporary)
                hdf5.read_back(artifact, temporary)
            inside.sync(temporary)
            sha256, size = digest.result(), temporary.stat().st_size
            temporary.replace(final)
            inside.sync(folder)
            put_file(final.absolute(), _DIGESTS, sha256)
        finally:
            temporary.unlink(missing_ok=True)
        output = {
            "kind": artifact.kind,
            "file": final.name,
            "sha256": sha256,
            "size": size,
            "content_digest": content_digest,
            "rows": rows_of(artifact),
        }
        if inside.kind(run, "running", f"{stage}.log") == "file":
            log = inside.path_of(run, "running", f"{stage}.log")
            log.replace(inside.path_of(base, *at, "stage.log"))
        seconds = round(float(record["seconds"]) + time.perf_counter() - clock, 3)  # of the method, and of writing
        full = {"schema": SCHEMA, "stage": stage, "key": key, **record, "seconds": seconds, "output": output}
        full["seal"] = seal(full)
        write_json(full, base, *at, RECORD)
        inside.sync(folder.parent)
    return full


def object_record(run: Path, stage: str, key: str) -> dict[str, Any] | None:
    """Record of a result; None if there is none, or it is not the record of this result."""
    record = read_record(base_of(run), OBJECTS, stage, key, RECORD)
    if record is None or (record["stage"], record["key"]) != (stage, key):
        return None
    return record


def records_of(run: Path, stage: str) -> Iterator[dict[str, Any]]:
    """The readable records of all results of a stage."""
    for key in inside.names_in(base_of(run), OBJECTS, stage):
        try:
            record = object_record(run, stage, key)
        except ArtifactError:
            continue
        if record is not None:
            yield record


def artifact_file(run: Path, record: Mapping[str, Any]) -> Path:
    """File of the artifact of a record.

    Raises
    ------
    FileNotFoundError
        If it is gone.
    ArtifactError
        If there is a link or something else in its place.
    """
    return inside.file_path(base_of(run), OBJECTS, record["stage"], record["key"], ARTIFACT)


def artifact_of(run: Path, record: Mapping[str, Any]) -> Path:
    """File of the artifact of a record, which should be there.

    Raises
    ------
    ArtifactError
        If it is gone, or there is something else in its place.
    """
    try:
        return artifact_file(run, record)
    except FileNotFoundError as error:
        what = "the artifact of the record is gone"
        raise ArtifactError(what, where=str(error.filename), remedy="aatri run") from error


def load_object(run: Path, record: Mapping[str, Any], kind: type[A], in_memory: Mapping[str, Artifact] = {}) -> A:
    """The artifact of a record, its file checked against it; one that is `in_memory` by its digest is not read.

    Raises
    ------
    ArtifactError
        If it is gone, or the file is not the one that was written.
    """
    from aatri.tables import hdf5

    path = artifact_of(run, record)
    if of_file(path.absolute(), _DIGESTS, file_sha256) != record["output"]["sha256"]:
        raise ArtifactError(
            "altered since it was written: its SHA-256 is not that of its record",
            where=str(path),
            remedy="aatri run makes it again",
        )
    kept = in_memory.get(record["output"]["content_digest"])
    return kept if isinstance(kept, kind) else hdf5.read(path, kind)
