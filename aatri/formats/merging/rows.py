"""Rows of two tables of one kind, joined by what identifies them; what two blocks say of the same thing.

That is the mean of two measurements, or a conflict that is told:

    x = P^-1 (P1 x1 + P2 x2),    P = P1 + P2,    Pi = Ci^-1 on what i has measured, 0 elsewhere

Two measurements within `sigmas` standard deviations of their difference are one thing measured twice, independently;
beyond that they are a conflict. What is exact in one has to be equal in the other. A measured value goes before a start
value, a role before none, and what one block has not been given is taken from the other.

Relative control of two blocks: equal conditions count once, those that state other values are conflicts.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, TypeVar

import numpy as np
import numpy.typing as npt

from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block, RelativeControl, RelativeControlMembers
from aatri.errors import Faults
from aatri.formats.limits import SAME_CONVERTED
from aatri.formats.tables.relative_control import conditions_of, tables_of_conditions
from aatri.ids import printable, shown
from aatri.tables.schema import Table, columns_of

T = TypeVar("T", bound=Table)

Duplicates = Literal["average", "first", "refuse"]
Conflicts = Literal["refuse", "first"]


@dataclass(frozen=True)
class Joined:
    """How the rows of a second table stand to those of a first."""

    row: Int
    """(n,). Row of the first that is equal, or else the first row of the same key; -1 where there is none."""
    equal: Bool
    """(n,). That row is equal."""

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
        same = np.isclose(a, b, rtol=SAME_CONVERTED, atol=0.0, equal_nan=True)
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
    is_stated = ~np.isnan(values) if values.dtype.kind == "f" else values >= 0
    return np.asarray(is_stated.reshape(len(values), -1).any(axis=1))


@dataclass
class Reconciliation:
    """What becomes of values in which two blocks differ, and what was told of it."""

    first: str
    second: str
    """What the two blocks are called."""
    duplicates: Duplicates
    """What becomes of two measurements that agree: their mean, the first, or an error."""
    conflicts: Conflicts
    """What becomes of values that exclude each other: an error, or the first goes on with a warning."""
    sigmas: float
    """Up to so many standard deviations of their difference two measurements agree."""
    faults: Faults = field(default_factory=Faults)
    warnings: list[str] = field(default_factory=list)
    means: dict[str, list[str]] = field(default_factory=dict)
    """What was averaged, by kind."""

    def conflict(self, what: str, values: Sequence[Any], where: str = "", more: str = "") -> None:
        """Two values that exclude each other."""
        text = f"{what}: {_shown(values[0])} in {self.first}, {_shown(values[1])} in {self.second}{more}"
        if self.conflicts == "first":
            self.warnings.append(f"{text}; that of {self.first} holds")
        else:
            remedy = "correct one, or give it another id (`prefix`, `rename`); `conflicts: first` takes the first"
            self.faults.add(text, where, remedy)

    def measured(self, kind: str, name: str, worst: float, where: str) -> bool:
        """Two measurements, `worst` standard deviations apart: whether they are to be averaged."""
        if worst > self.sigmas or self.duplicates == "refuse":
            what = "too far for one thing" if worst > self.sigmas else "`duplicates: refuse`"
            text = f"{kind} {printable(name)} measured in {self.first} and in {self.second}, "
            text += f"{worst:.1f} standard deviations of the difference apart ({what})"
            if worst > self.sigmas and self.conflicts == "first":
                self.warnings.append(f"{text}; that of {self.first} holds")
            else:
                self.faults.add(
                    text, where, "remove or rename the wrong one, or `duplicates: average` where both are right"
                )
            return False
        if self.duplicates == "average":
            self.means.setdefault(kind, []).append(printable(name))
        return self.duplicates == "average"


def apart(x: Float, C: Float, used: Bool, other: tuple[Float, Float, Bool]) -> tuple[Float, Bool]:
    """Differences of the common components in standard deviations, and which common ones are exact in either, (n,)."""
    y, D, also = other
    both = used & also
    variance = np.diagonal(C) + np.diagonal(D)
    exact = both & ((np.diagonal(C) == 0) | (np.diagonal(D) == 0))
    normal = both & ~exact
    sigmas = np.where(normal, np.abs(np.where(both, x - y, 0.0)) / np.sqrt(np.where(normal, variance, 1.0)), 0.0)
    return sigmas, exact


def mean_of_two(x: Float, C: Float, used: Bool, other: tuple[Float, Float, Bool]) -> tuple[Float, Float]:
    """Weighted mean of two independent measurements and its covariance, each of some components.

    Parameters
    ----------
    x : (n,) float64
    C : (n, n) float64
    used : (n,) bool
    other : the same of the second
        Exact components have to be equal in both.

    Returns
    -------
    x : (n,) float64
        NaN where neither has measured.
    C : (n, n) float64
        Zero where exact.
    """
    y, D, also = other
    exact = (used & (np.diagonal(C) == 0)) | (also & (np.diagonal(D) == 0))
    P, Q = _weights(C, used & ~exact), _weights(D, also & ~exact)
    free = (used | also) & ~exact
    mean = np.where(used, x, y)
    covariance = np.zeros_like(C)
    if free.any():
        inside = np.ix_(free, free)
        covariance[inside] = np.linalg.inv((P + Q)[inside])
        right = P @ np.where(used, x, 0.0) + Q @ np.where(also, y, 0.0)
        mean[free] = covariance[inside] @ right[free]
    return mean, covariance


def _weights(C: Float, used: Bool) -> Float:
    P = np.zeros_like(C)
    if used.any():
        inside = np.ix_(used, used)
        P[inside] = np.linalg.inv(C[inside])
    return P


def _shown(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"({', '.join(_shown(v) for v in value.ravel())})"
    return f"{value:.10g}" if isinstance(value, float) else printable(str(value)) or "none"


def merged_conditions(a: Block, b: Block, rules: Reconciliation) -> tuple[RelativeControl, RelativeControlMembers]:
    """The conditions of both blocks; type, axis and members identify one."""
    merged = conditions_of(a)
    first = {c[:3]: np.array([c.value, c.sigma]) for c in merged}
    for k, c in enumerate(conditions_of(b)):
        values = np.array([c.value, c.sigma])
        if c[:3] not in first:
            merged.append(c._replace(file=c.file + len(a.files) if c.file >= 0 else -1))
        elif not np.allclose(first[c[:3]], values, rtol=SAME_CONVERTED, atol=0.0, equal_nan=True):
            called = f"{c.type} of {shown([name for _, name in c.members])}: value and sigma"
            rules.conflict(called, [first[c[:3]], values], b.read_at(b.relative_control, k))
    return tables_of_conditions(merged)
