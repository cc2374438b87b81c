"""Artifacts in HDF5: one group per table, one dataset per column, attributes at the root.

Every dataset carries `units` and `description`, row numbers also `refers`, so that the file reads without aatri.
The group `notes`, of any kind of artifact, holds what its stage warned of; it is no part of the content.
`write` puts a whole file on disk and reads it back; making it appear atomically is the store's work.
Files are read through the guard (`hdf5_guard`): hard links only, nothing in other files, known filters and dtypes, a
bounded size; and with exactly the declared names.
"""

from collections.abc import Collection, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np
import numpy.typing as npt

from aatri.arrays import Text
from aatri.errors import ArtifactError, ResourceError
from aatri.ids import did_you_mean
from aatri.tables.checked_column import DTYPES, Column
from aatri.tables.digest import content_digest, same_content
from aatri.tables.hdf5_guard import guarded, scalar_of
from aatri.tables.schema import Artifact, Table, attributes_of, column, columns_of, may_be_absent, size_of, tables_of
from aatri.tables.utf8 import decoded, encoded

A = TypeVar("A", bound=Artifact)

IN_MEMORY_BYTES = 1 << 29
"""Up to this size a file is put together in memory: HDF5 crashes the process if the disk fails it while it writes."""
CHUNK_BYTES = 1 << 20
"""Columns have a checksum for every so many bytes: as many as HDF5 keeps in memory of a column by default."""
_LIBVER = ("v110", "v110")  # metadata checksums, and a file left open by a crash refuses to open
NOTES = "notes"


class Notes(Table):
    """What the stage that made the artifact had to say of it."""

    level: Text = column("str", doc="warning")
    text: Text = column("str", doc="in words, with the ids it is about")


def write(artifact: Artifact, path: Path, warnings: Sequence[str] = ()) -> str:
    """Write the artifact to a new file, read it back, and return its content digest; see `put` and `read_back`."""
    digest = put(artifact, path, warnings)
    read_back(artifact, path)
    return digest


def put(artifact: Artifact, path: Path, warnings: Sequence[str] = ()) -> str:
    """Write the artifact to a new file, with what its stage warned of, and return its content digest.

    Raises
    ------
    ResourceError
        If the file cannot be written whole (disk full, permission).
    """
    with _on_disk("cannot write", path, "free space or use --into"):
        in_memory = size_of(artifact) <= IN_MEMORY_BYTES
        driver = {"driver": "core", "backing_store": False} if in_memory else {}
        with ThreadPoolExecutor(1) as hashing, h5py.File(path, "w-", libver=_LIBVER, **driver) as file:
            digesting = hashing.submit(content_digest, artifact)
            file.attrs["schema_version"] = artifact.schema_version
            for name, declared in attributes_of(type(artifact)).items():
                value = getattr(artifact, name)
                about = {f"{name}.description": declared.doc + (f" [{declared.unit}]" if declared.unit else "")}
                _describe_by(file.id, **about | ({name: value} if isinstance(value, str) else {}))
                if not isinstance(value, str):
                    file.attrs[name] = value
            for name in tables_of(type(artifact)):
                rows = getattr(artifact, name)
                if rows is not None:
                    _write_table(file.create_group(name), rows)
            if warnings:
                texts = [warning.encode("utf-8", "backslashreplace").decode() for warning in warnings]
                notes = Notes(level=np.full(len(warnings), "warning"), text=np.array(texts))
                _write_table(file.create_group(NOTES), notes)
            digest = digesting.result()
            _describe_by(file.id, aatri_kind=artifact.kind, content_digest=digest)
            if in_memory:
                file.flush()
                image = file.id.get_file_image()
        if in_memory:
            with path.open("xb") as plain:
                plain.write(image)
    return digest


def read_back(artifact: Artifact, path: Path) -> None:
    """Compare a file that was just written with its artifact, bit by bit.

    Raises
    ------
    ResourceError
        If it differs, or cannot be read.
    """
    damaged = _on_disk("cannot be read back", path, "check the disk")
    with damaged, h5py.File(path, "r") as file:  # its own file, which holds what the guard lets pass
        same = same_content(artifact, _read(file, type(artifact), str(path)))
    if not same:
        raise ResourceError("reads back differently from what was written", where=str(path), remedy="check the disk")


@contextmanager
def _on_disk(what: str, path: Path, remedy: str) -> Iterator[None]:
    """Errors of a disk as ResourceError."""
    try:
        yield
    except ArtifactError:
        raise
    except (OSError, RuntimeError) as error:  # h5py tells of a failed close as RuntimeError
        raise ResourceError(f"{what}: {error}", where=str(path), remedy=remedy) from error


def read(path: Path, cls: type[A], only: Collection[str] | None = None) -> A:
    """Read an artifact of the given kind.

    Parameters
    ----------
    only : collection of str, optional
        Tables that are wanted, with those they refer to; the others are without rows.

    Raises
    ------
    ArtifactError
        If the file is missing, no artifact, of another kind or not of the declared schema.
    """
    with guarded(path) as file:
        return _read(file, cls, str(path), only)


def read_warnings(path: Path) -> tuple[str, ...]:
    """What the stage that made an artifact warned of.

    Raises
    ------
    ArtifactError
        If the file is missing or no HDF5 file, or its notes are not of their schema.
    """
    with guarded(path) as file:
        if NOTES not in file:
            return ()
        notes = _read_table(file[NOTES], Notes, f"{path}:{NOTES}")
    assert isinstance(notes, Notes)
    return tuple(str(text) for text in notes.text)


def read_header(path: Path) -> dict[str, Any]:
    """Kind, attributes and row counts of an artifact, without its data: `{"kind", "attributes", "tables"}`.

    Raises
    ------
    ArtifactError
        As `read`.
    """
    with guarded(path) as file:
        if "aatri_kind" not in file.attrs:
            raise ArtifactError("an HDF5 file, but no aatri artifact", where=str(path))
        attributes = {k: scalar_of(v) for k, v in file.attrs.items() if not k.endswith(".description")}
        tables = {name: _describe(file[name]) for name in file}
    return {"kind": str(attributes.pop("aatri_kind")), "attributes": attributes, "tables": tables}


def read_plain(path: Path) -> dict[str, npt.NDArray[Any]]:
    """All scalars by name and columns by `table/column`, whatever the kind; text as bytes.

    Raises
    ------
    ArtifactError
        As `read`.
    """
    with guarded(path) as file:
        scalars = {name: np.asarray(value) for name, value in file.attrs.items() if name != "content_digest"}
        columns = {f"{table}/{name}": column[()] for table, group in file.items() for name, column in group.items()}
    return scalars | columns


def _describe(group: h5py.Group) -> dict[str, Any]:
    columns = {}
    for name, dataset in group.items():
        columns[name] = {
            "shape": dataset.shape,
            "units": scalar_of(dataset.attrs.get("units", "")),
            "description": scalar_of(dataset.attrs.get("description", "")),
        }
    rows = next(iter(columns.values()))["shape"][0] if columns else 0
    return {"rows": int(rows), "description": scalar_of(group.attrs.get("description", "")), "columns": columns}


def _write_table(group: h5py.Group, rows: Table) -> None:
    """By the lower level, as `_read_column`."""
    _describe_by(group.id, description=(type(rows).__doc__ or "").strip().splitlines()[0])
    for name, declared in columns_of(type(rows)).items():
        values, is_text = np.ascontiguousarray(getattr(rows, name)), declared.dtype == "str"
        data = encoded(values) if is_text else values
        kind = _text_type(max(1, data.itemsize)) if is_text else _number_type(data.dtype)
        data = data.astype(kind.dtype, copy=False)
        creation = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        if data.size:
            creation.set_chunk((min(len(data), max(1, CHUNK_BYTES * len(data) // data.nbytes)), *data.shape[1:]))
            creation.set_fletcher32()
        creation.set_obj_track_times(False)
        dataset = h5py.h5d.create(group.id, name.encode(), kind, h5py.h5s.create_simple(data.shape), creation)
        if data.size:
            dataset.write(h5py.h5s.ALL, h5py.h5s.ALL, data, kind)
        refers = {"refers": declared.refers} if declared.refers else {}
        _describe_by(dataset, units=declared.unit, description=declared.doc, **refers)


def _describe_by(owner: h5py.h5g.GroupID | h5py.h5d.DatasetID, **texts: str) -> None:
    """Texts of fixed length (`hdf5_guard`) as attributes: most of what is written."""
    one_value = h5py.h5s.create(h5py.h5s.SCALAR)
    for name, text in texts.items():
        data = np.array(text.encode())
        kind = _text_type(max(1, data.itemsize))
        h5py.h5a.create(owner, name.encode(), kind, one_value).write(data, mtype=kind)


@cache
def _text_type(width: int) -> h5py.h5t.TypeID:
    return h5py.h5t.py_create(h5py.string_dtype("utf-8", width), logical=True)


@cache
def _number_type(dtype: np.dtype[Any]) -> h5py.h5t.TypeID:
    return h5py.h5t.py_create(dtype, logical=True)


def _read(file: h5py.File, cls: type[A], path: str, only: Collection[str] | None = None) -> A:
    kind = scalar_of(file.attrs.get("aatri_kind", ""))
    if kind != cls.kind:
        what = f"an artifact of kind {kind}" if kind else "no aatri artifact"
        raise ArtifactError(f"{what}, where {cls.kind} is wanted", where=path, remedy="check `from` in pipeline.yaml")
    version = scalar_of(file.attrs.get("schema_version", 0))
    if version != cls.schema_version:
        raise ArtifactError(
            f"{kind} of schema version {version}; this aatri reads version {cls.schema_version}",
            where=path,
            remedy="run the stage again",
        )
    fields: dict[str, Any] = {}
    for name in attributes_of(cls):
        if name not in file.attrs:
            raise ArtifactError(f"{kind} without attribute {name}", where=path)
        fields[name] = scalar_of(file.attrs[name])
    declared, present = tables_of(cls), set(file)
    for name in present:
        if name not in declared and name != NOTES:
            raise ArtifactError(f"{kind} has an unknown table {name!r}{did_you_mean(name, declared)}", where=path)
    for name, table_cls in declared.items():
        if only is not None and name not in only and not may_be_absent(cls, name):
            fields[name] = table_cls.empty()
        elif name in present and (only is None or name in only):
            fields[name] = _read_table(file[name], table_cls, f"{path}:{name}")
        elif not may_be_absent(cls, name):
            raise ArtifactError(f"{kind} without table {name}", where=path)
    return cls(**fields)


def _read_table(group: h5py.Group, cls: type[Table], where: str) -> Table:
    declared, present = columns_of(cls), set(group)
    for name in present:
        if name not in declared:
            raise ArtifactError(f"unknown column {name!r}{did_you_mean(name, declared)}", where=where)
    if missing := [name for name in declared if name not in present and not may_be_absent(cls, name)]:
        raise ArtifactError(f"columns missing: {', '.join(missing)}", where=where)
    columns = {name: c for name, c in declared.items() if name in present}
    return cls(**{name: _read_column(group, name, c, f"{where}/{name}") for name, c in columns.items()})


def _read_column(group: h5py.Group, name: str, declared: Column, where: str) -> npt.NDArray[Any]:
    """By the lower level: most of the time of small files goes by objects of h5py."""
    dataset = h5py.h5d.open(group.id, name.encode())
    values = np.zeros(dataset.shape, dataset.dtype)
    if values.size:  # HDF5 takes its time over nothing
        dataset.read(h5py.h5s.ALL, h5py.h5s.ALL, values)
    if declared.dtype == "str":
        if h5py.check_string_dtype(values.dtype) is None:
            raise ArtifactError(f"holds {values.dtype}, not text", where=where)
        return decoded(np.asarray(values, dtype=np.bytes_))
    if values.dtype != np.dtype(DTYPES[declared.dtype]):
        raise ArtifactError(f"holds {values.dtype}, not {declared.dtype}", where=where)
    return np.asarray(values)
