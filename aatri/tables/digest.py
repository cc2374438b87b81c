"""Content digest: SHA-256 over a canonical walk of an artifact, independent of how HDF5 stores it.

Attributes and columns are visited in declared order; each contributes its path, dtype, shape and little-endian bytes,
text its UTF-8 bytes with their lengths. Provenance columns (`digest=False`) do not count, so that a comment line
added to a CSV file changes no content.
"""

import hashlib
import json

import numpy as np

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
