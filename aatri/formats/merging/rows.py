"""Rows of two tables of one kind, joined by what identifies them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from aatri.arrays import Bool, Int
from aatri.tables.schema import Table, columns_of

T = TypeVar("T", bound=Table)

SAME = 1e-12
"""Relative: figures that were converted, printed and read again."""


@dataclass(frozen=True)
class Joined:
    """How the rows of a second table stand to those of a first.

    Attributes
    ----------
    row : (n,) int64
        Row of the first that is equal, or else the first row of the same key; -1 where there is none.
    equal : (n,) bool
        That row is equal.
    """

    row: Int
    equal: Bool

    @property
    def differing(self) -> Int:
        """Rows of the second whose key the first has with other values."""
        return np.flatnonzero((self.row >= 0) & ~self.equal)

    @property
    def fresh(self) -> Bool:
        """Rows of the second whose key the first does not have, (n,)."""
        return np.asarray(self.row < 0)


def joined_by(first: Table, second: Table, key: Sequence[str], beside: Sequence[str] = ()) -> Joined:
    """Rows of the second table among those of the first.

    Parameters
    ----------
    first, second : Table
        With rows of other tables that count alike in both.
    key : sequence of str
        Columns that identify a row; several rows may have one key.
    beside : sequence of str
        Columns that are not compared.
    """
    n = len(first)
    code = np.zeros(n + len(second), dtype=np.int64)
    for name in key:
        values = np.concatenate([getattr(first, name), getattr(second, name)])
        _, of_column = np.unique(values, return_inverse=True)
        _, code = np.unique(code * (of_column.max(initial=0) + 1) + of_column, return_inverse=True)
    order = np.argsort(code[:n], kind="stable")
    low, high = (np.searchsorted(code[:n][order], code[n:], side) for side in ("left", "right"))
    row = np.where(high > low, np.append(order, -1)[np.minimum(low, n)], -1)
    equal = np.zeros(len(second), dtype=bool)
    for k in range(int((high - low).max(initial=0))):
        here = np.flatnonzero((low + k < high) & ~equal)
        candidate = order[low[here] + k]
        same = _equal(first, candidate, second, here, {*key, *beside})
        row[here[same]], equal[here[same]] = candidate[same], True
    return Joined(row, equal)


def values_equal(a: npt.NDArray[Any], b: npt.NDArray[Any]) -> Bool:
    """Which rows of two columns are equal."""
    if a.dtype.kind == "f":
        same = np.isclose(a, b, rtol=SAME, atol=0.0, equal_nan=True)
    else:
        same = a == b
    return np.asarray(same.reshape(len(same), -1).all(axis=1))


def _equal(first: Table, rows: Int, second: Table, others: Int, beside: set[str]) -> Bool:
    same = np.ones(len(rows), dtype=bool)
    for name, declared in columns_of(type(first)).items():
        if declared.digest and name not in beside:
            same &= values_equal(getattr(first, name)[rows], getattr(second, name)[others])
    return same


def with_rows(table: T, rows: Int, **values: npt.ArrayLike) -> T:
    """The table with other values in some rows of some columns."""
    columns: dict[str, Any] = {name: getattr(table, name).copy() for name in columns_of(type(table))}
    for name, new_values in values.items():
        if columns[name].dtype.kind == "U":  # which a longer text would not fit
            columns[name] = columns[name].astype(np.result_type(columns[name], np.asarray(new_values)))
        columns[name][rows] = new_values
    return type(table)(**columns)


def stated(table: Table, name: str) -> Bool:
    """Rows in which a column is given, (n,)."""
    values = getattr(table, name)
    if values.dtype.kind == "U":
        return np.asarray(values != "")
    given = ~np.isnan(values) if values.dtype.kind == "f" else values >= 0
    return np.asarray(given.reshape(len(values), -1).any(axis=1))
