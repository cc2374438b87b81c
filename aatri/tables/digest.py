"""Whether two artifacts have the same content, and its digest: SHA-256 over a canonical walk, however HDF5 keeps it.

Attributes and columns are visited in declared order; each contributes its path, dtype, shape and little-endian bytes,
text its UTF-8 bytes with their lengths. Provenance columns (`digest=False`) do not count, so that a comment line
added to a CSV file changes no content.
"""

import hashlib
import json
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.tables.schema import Artifact, Table, attributes_of, columns_of, tables_of
from aatri.tables.utf8 import lengths_and_bytes


def content_digest(artifact: Artifact, *, without: frozenset[str] = frozenset()) -> str:
    """Hex SHA-256 of the content.

    Parameters
    ----------
    without : frozenset of str
        Tables to leave out.
    """
    digest = hashlib.sha256()
    scalars = {name: getattr(artifact, name) for name in attributes_of(type(artifact))}
    head = {"kind": artifact.kind, "version": artifact.schema_version, "attributes": scalars}
    digest.update(json.dumps(head, sort_keys=True, ensure_ascii=False).encode())
    for name in tables_of(type(artifact)):
        rows = getattr(artifact, name)
        if rows is not None and name not in without:
            digest.update(name.encode() + b"\0" + table_digest(rows))
    return digest.hexdigest()


def table_digest(rows: Table) -> bytes:
    """SHA-256 of the columns of one table."""
    digest = hashlib.sha256()
    for name, declared in columns_of(type(rows)).items():
        if not declared.digest:
            continue
        values = getattr(rows, name)
        digest.update(f"{name}\0{declared.dtype}\0{values.shape}\0".encode())
        if declared.dtype == "str":
            length, data = lengths_and_bytes(values)
            digest.update(length.astype("<i8").tobytes() + data)
        else:
            little = values.astype(values.dtype.newbyteorder("<"), copy=False)
            if declared.dtype == "f8":
                little = little + 0.0  # one zero, one NaN
                little[np.isnan(little)] = np.nan
            digest.update(np.ascontiguousarray(little).reshape(-1).view(np.uint8).data)
    return digest.digest()


def same_content(a: Artifact, b: Artifact) -> bool:
    """Whether all attributes and columns of two artifacts of a kind are the same bits."""
    cls = type(a)
    pairs = [(np.array(getattr(a, name)), np.array(getattr(b, name))) for name in attributes_of(cls)]
    for name in tables_of(cls):
        one, other = getattr(a, name), getattr(b, name)
        if (one is None) != (other is None):
            return False
        if one is not None:
            pairs += [(getattr(one, c), getattr(other, c)) for c in columns_of(type(one))]
    return all(_equal(*pair) for pair in pairs)


def _equal(a: npt.NDArray[Any], b: npt.NDArray[Any]) -> bool:
    if a.shape != b.shape or a.dtype.kind == "U" or a.dtype != b.dtype:
        return np.array_equal(a, b)
    one, other = (np.ascontiguousarray(x).reshape(-1).view(np.uint8) for x in (a, b))
    words = len(one) // 8 * 8
    by_words = np.array_equal(one[:words].view(np.uint64), other[:words].view(np.uint64))
    return by_words and np.array_equal(one[words:], other[words:])


def same_rows(a: object, b: object) -> bool:
    """Whether two tables say the same; NaN is equal to itself."""
    if not isinstance(a, Table) or type(a) is not type(b):
        return False
    pairs = ((getattr(a, name), getattr(b, name)) for name in columns_of(type(a)))
    return all(np.array_equal(x, y, equal_nan=x.dtype.kind == "f") for x, y in pairs)
