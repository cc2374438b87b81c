"""Opening of HDF5 files of unknown origin: everything in them is looked at before anything is read.

HDF5 can name other files (external links, external storage, virtual datasets), load filters from elsewhere, go in
circles, and declare terabytes in a few kilobytes. An artifact does none of it, so the guard takes only

- groups and datasets that are reached by hard links, each by one name, in at most `MAX_DEPTH` levels;
- datasets stored within the file, of integers, 8-byte floats, truth values or texts of fixed length, at least one-
  dimensional, unfiltered or through `FILTERS`, each at most once;
- columns that declare in total at most `RATIO` times the size of the file, and 1 MiB;
- attributes that are one number, truth value or text of fixed length, of at most `LONGEST` bytes. Texts of variable
  length lie in heaps without a checksum, and a wrong byte there has the library read for ever.

Whatever the library itself fails at, on a damaged file, ends as ArtifactError too. Stages, `show`, `compare`, `export`
and the report all read artifacts through it.
"""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from aatri.errors import AatriError, ArtifactError
from aatri.ids import clipped
from aatri.regular_file import open_regular

FILTERS = {h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_FLETCHER32}
"""Byte shuffling, zlib, checksum. Any other filter may be code that the library loads from elsewhere."""
MAX_DEPTH, MAX_OBJECTS, MAX_ATTRIBUTES = 2, 10_000, 1000
RATIO, FREE_BYTES = 100, 1 << 20
LONGEST = 1 << 16

_LAYOUTS = {h5py.h5d.COMPACT, h5py.h5d.CONTIGUOUS, h5py.h5d.CHUNKED}


@contextlib.contextmanager
def guarded(path: Path) -> Iterator[h5py.File]:
    """An HDF5 file opened to read, all of it looked at.

    Raises
    ------
    ArtifactError
        If it is missing, no HDF5 file, damaged, or holds what an artifact does not.
    """
    try:
        with open_regular(path) as plain:
            size = plain.seek(0, 2)
        with h5py.File(path, "r") as file:
            _look_at_all(file, path, size)
            yield file
    except (AatriError, MemoryError):
        raise
    except (FileNotFoundError, NotADirectoryError) as error:
        raise ArtifactError("no such artifact", where=str(path), remedy="run the stage that makes it") from error
    except Exception as error:  # of a damaged file the library tells in many ways
        what = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ArtifactError(f"not a readable HDF5 file: {what}", where=str(path), remedy="run it again") from error


def scalar_of(value: Any) -> Any:
    """The value of an attribute as text, number or truth value."""
    if isinstance(value, bytes):
        return value.decode()
    return value.item() if isinstance(value, np.generic) else value


def _look_at_all(file: h5py.File, path: Path, size: int) -> None:
    seen: set[int] = set()
    declared, waiting = 0, [(file.id, "", 0)]
    _attributes(file.id, str(path))
    while waiting:
        group, name, depth = waiting.pop()
        for key in group:
            where = f"{path}:{name}/{clipped(key.decode('utf-8', 'replace'))}".replace(":/", ":")
            link = group.links.get_info(key)
            if link.type != h5py.h5l.TYPE_HARD:
                raise ArtifactError("a link to elsewhere", where=where)
            if link.u in seen:  # the address of what it leads to
                raise ArtifactError("the same thing under two names", where=where)
            seen.add(link.u)
            if len(seen) > MAX_OBJECTS:
                raise ArtifactError(f"more than {MAX_OBJECTS} tables and columns", where=str(path))
            inner = h5py.h5o.open(group, key)
            _attributes(inner, where)
            if isinstance(inner, h5py.h5d.DatasetID) and depth == 1:
                declared += _dataset(inner, where)
                if declared > FREE_BYTES + RATIO * size:
                    raise ArtifactError(f"declares {declared} bytes in a file of {size}", where=where)
            elif isinstance(inner, h5py.h5g.GroupID) and depth + 1 < MAX_DEPTH:
                waiting.append((inner, f"{name}/{key.decode('utf-8', 'replace')}", depth + 1))
            else:
                raise ArtifactError("not a table at the top, nor a column in a table", where=where)


def _dataset(column: h5py.h5d.DatasetID, where: str) -> int:
    """Bytes that a column declares, the memory of its chunks included."""
    creation = column.get_create_plist()
    layout = creation.get_layout()
    if layout not in _LAYOUTS or creation.get_external_count():
        raise ArtifactError("stored in another file", where=where)
    filters = [creation.get_filter(k)[0] for k in range(creation.get_nfilters())]
    if not set(filters) <= FILTERS or len(set(filters)) < len(filters):
        raise ArtifactError(f"stored through filters {filters}, which no artifact has", where=where)
    shape = column.shape
    if not shape or len(shape) > 4:
        raise ArtifactError("not a column: it has no rows", where=where)
    kind = column.get_type()
    _dtype(kind, where)
    item = kind.get_size()
    chunk = creation.get_chunk() if layout == h5py.h5d.CHUNKED else ()
    return _product(shape, item) + _product(chunk, item)


def _dtype(kind: Any, where: str) -> None:
    """Refuse what is no number, truth value or text of fixed length."""
    dtype = kind.dtype
    right = dtype.kind in "iufbS" and (dtype.kind == "S" or dtype.itemsize <= 8)
    if kind.get_class() == h5py.h5t.ENUM:
        right = dtype == np.bool_
    if not right or dtype.subdtype is not None:
        raise ArtifactError(f"holds {clipped(str(dtype))}, neither numbers nor texts of fixed length", where=where)


def _attributes(owner: Any, where: str) -> None:
    count = h5py.h5a.get_num_attrs(owner)
    if count > MAX_ATTRIBUTES:
        raise ArtifactError(f"{count} attributes", where=where)
    for k in range(count):
        attribute = h5py.h5a.open(owner, index=k)
        kind = attribute.get_type()
        if attribute.get_space().get_simple_extent_type() != h5py.h5s.SCALAR:
            raise ArtifactError(f"attribute {_name(attribute)} is not one value", where=where)
        if kind.get_class() != h5py.h5t.STRING:
            _dtype(kind, f"{where}, attribute {_name(attribute)}")
        elif kind.is_variable_str():
            raise ArtifactError(
                f"attribute {_name(attribute)} is a text of variable length",
                where=where,
                remedy="run it again: older versions wrote such",
            )
        elif kind.get_size() > LONGEST:
            raise ArtifactError(f"attribute {_name(attribute)} is a text of {kind.get_size()} bytes", where=where)


def _name(attribute: h5py.h5a.AttrID) -> str:
    return clipped(attribute.name.decode("utf-8", "replace"))


def _product(shape: tuple[int, ...], item: int) -> int:
    total = int(item)
    for n in shape:
        total *= int(n)
    return total
