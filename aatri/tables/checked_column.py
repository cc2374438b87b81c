"""A column as it is declared: its dtype and shape, finite numbers, contiguous, not to be written to."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.arrays import is_uniform
from aatri.errors import ArtifactError

DTYPES: dict[str, Any] = {"f8": np.float64, "i4": np.int32, "i8": np.int64, "i1": np.int8, "bool": np.bool_}


@dataclass(frozen=True)
class Column:
    """Declaration of one column.

    `digest` is False for provenance, which is not part of the content. Without a `default` it has to be stated.
    `uniform` columns of long tables often have one value in all rows, which then is in memory once: a view of it.
    """

    dtype: str
    shape: tuple[int, ...]
    unit: str
    doc: str
    refers: str
    optional: bool
    digest: bool
    default: str | float | bool | None = None
    uniform: bool = False


def checked(table_name: str, name: str, declared: Column, values: Any) -> npt.NDArray[Any]:
    """The values of a column as an array of its declaration; one value of a uniform column as a view of it.

    Raises
    ------
    ArtifactError
        If they are none of its dtype and shape, too large for it, or not finite.
    """
    where = f"{table_name}.{name}"
    array = np.asarray(values)
    if declared.dtype == "str":
        array = array.astype(np.str_, copy=False) if array.size else np.zeros(array.shape, "U1")
    else:
        expected = np.dtype(DTYPES[declared.dtype])
        if array.dtype != expected:
            if not np.can_cast(array.dtype, expected, "same_kind") and array.size:
                raise ArtifactError(f"{where} is {array.dtype}, not {expected}")
            narrowed = array.astype(expected)
            if np.issubdtype(expected, np.integer) and array.size and not np.array_equal(narrowed, array):
                raise ArtifactError(f"{where} holds a number too large for {expected}")
            array = narrowed
    if array.ndim != 1 + len(declared.shape) or array.shape[1:] != declared.shape:
        raise ArtifactError(f"{where} has shape {array.shape}, not (n, {', '.join(map(str, declared.shape))})")
    if declared.dtype == "f8" and array.size:
        bad = np.isinf(array) if declared.optional else ~np.isfinite(array)
        if bad.any():
            row = int(np.argwhere(bad)[0][0])
            raise ArtifactError(f"{where} holds {array[bad][0]} in row {row}")
    if declared.uniform and is_uniform(array):
        return np.broadcast_to(array[:1].copy(), array.shape)
    array = np.ascontiguousarray(array)
    array.flags.writeable = False
    return array
