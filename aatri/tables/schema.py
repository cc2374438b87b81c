"""Declaration of tables and artifacts: every field once, with dtype, shape, unit and description.

A table is a frozen dataclass of columns of equal length; an artifact is a frozen dataclass of attributes and tables.
Both are declared with the field functions below and checked whenever one is made, so also on read and before write.
A class below `Table` or `Artifact` is such a dataclass by itself, and cannot be made one once more.

    class Images(Table):
        '''Images of the block.'''
        id: Text = column("str", doc="id of the image")
        strip: Int = column("i4", doc="row in strips", refers="strips", optional=True)

Dtypes are `f8 i4 i8 i1 bool str`. In `f8` NaN means *not given* and is allowed only in optional columns; in a row
number -1 does. Infinities are never allowed.
"""

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from html import escape
from typing import Any, ClassVar, Self, TypeVar, cast, dataclass_transform

import numpy as np
import numpy.typing as npt

from aatri.errors import ArtifactError
from aatri.ids import several
from aatri.tables.checked_column import DTYPES, Column, checked
from aatri.tables.offers import Offer
from aatri.units import DASH

F = TypeVar("F", bound=Callable[..., Any])

ATTRIBUTE_TYPES = (str, int, float, bool)


@dataclass(frozen=True)
class Attribute:
    """Declaration of one scalar of an artifact: text, integer, float or truth value."""

    unit: str
    doc: str


def column(
    dtype: str,
    *shape: int,
    unit: str = "",
    doc: str,
    refers: str = "",
    optional: bool = False,
    digest: bool = True,
    default: str | float | bool | None = None,
    absent: bool = False,
    uniform: bool = False,
) -> Any:
    """Field of a `Table`: one value of `shape` per row. `refers` names the table whose rows it holds.

    `default` is the value of rows that a reader does not state; that of an optional column is *not given*. A column
    that may be `absent` need not be stated when a table is made, nor be in a file.
    """
    if optional and default is None:
        default = np.nan if dtype == "f8" else -1
    declared = Column(dtype, shape, unit, doc, refers, optional, digest, default, uniform)
    return dataclasses.field(default=None if absent else dataclasses.MISSING, metadata={"column": declared})


def attribute(*, unit: str = "", doc: str, default: Any = dataclasses.MISSING) -> Any:
    """Field of an `Artifact`: one scalar."""
    return dataclasses.field(default=default, metadata={"attribute": Attribute(unit, doc)})


def table(*, doc: str = "", default: Any = dataclasses.MISSING) -> Any:
    """Field of an `Artifact`: a table; with `default=None` an optional group."""
    return dataclasses.field(default=default, metadata={"table": doc})


@dataclass_transform(eq_default=False, frozen_default=True)
@dataclass(frozen=True, eq=False, repr=False)
class Table:
    """Base of all tables: checks and converts its columns when made."""

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True, eq=False, repr=False)(cls)

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {several(len(self), 'row')} of {', '.join(columns_of(type(self)))}>"

    def __post_init__(self) -> None:
        lengths = {}
        for name, declared in columns_of(type(self)).items():
            if getattr(self, name) is None and may_be_absent(type(self), name):
                object.__setattr__(self, name, np.full((len(self), *declared.shape), np.nan))
            values = checked(type(self).__name__, name, declared, getattr(self, name))
            object.__setattr__(self, name, values)
            lengths[name] = len(values)
        if len(set(lengths.values())) > 1:
            raise ArtifactError(f"columns of {type(self).__name__} differ in length: {lengths}")

    def __len__(self) -> int:
        return len(getattr(self, next(iter(columns_of(type(self))))))

    @classmethod
    def empty(cls) -> Self:
        """The table without rows."""
        return cls(**{name: np.zeros((0, *c.shape), DTYPES.get(c.dtype, "U1")) for name, c in columns_of(cls).items()})

    @classmethod
    def of(cls, **columns: npt.ArrayLike) -> Self:
        """The table of some columns; one value stands for all rows, and what is not stated has its default.

        Raises
        ------
        ArtifactError
            If a column without a default is missing, or there is no such column.
        """
        declared = columns_of(cls)
        unknown = sorted(columns.keys() - declared.keys())
        missing = [name for name, c in declared.items() if name not in columns and c.default is None]
        if unknown or missing:
            raise ArtifactError(
                f"{cls.__name__}: no column {', '.join(unknown) or 'is unknown'}; "
                f"missing: {', '.join(missing) or 'none'}"
            )
        stated = {name: np.asarray(values) for name, values in columns.items()}
        lengths = [len(v) if v.size else 0 for name, v in stated.items() if _has_rows(v, declared[name])]
        n = max(lengths, default=1 if stated else 0)
        return cls(**{name: _of_rows(stated.get(name), c, n) for name, c in declared.items()})

    def followed_by(self, other: Self) -> Self:
        """The rows of this table, and those of another below them."""
        names = columns_of(type(self))
        return type(self)(**{name: np.concatenate([getattr(self, name), getattr(other, name)]) for name in names})

    def take(self, rows: npt.ArrayLike) -> Self:
        """The table of the chosen rows (numbers or a mask), in their order."""
        chosen = np.asarray(rows)
        return type(self)(**{name: getattr(self, name)[chosen] for name in columns_of(type(self))})


@dataclass_transform(eq_default=False, frozen_default=True)
@dataclass(frozen=True, eq=False, repr=False)
class Artifact:
    """Base of all kinds: `kind`, the name of the class, and `schema_version`; fields are attributes and tables."""

    kind: ClassVar[str] = ""
    schema_version: ClassVar[int] = 1

    def __init_subclass__(cls) -> None:
        cls.kind = vars(cls).get("kind", cls.__name__)
        dataclass(frozen=True, eq=False, repr=False)(cls)

    def __repr__(self) -> str:
        scalars = [f"{name} {getattr(self, name)!r}" for name in attributes_of(type(self))]
        tables = {name: getattr(self, name) for name in tables_of(type(self))}
        counts = [f"{len(rows)} {name}" for name, rows in tables.items() if rows is not None and len(rows)]
        return f"<{self.kind}: {', '.join([*scalars, *counts])}>"

    def _repr_html_(self) -> str:
        """For notebooks: attributes, and tables with their rows."""
        values = {name: getattr(self, name) for name in attributes_of(type(self))}
        floats = {name: value for name, value in values.items() if isinstance(value, float)}
        values |= {name: f"{value:.6g}" if value == value else DASH for name, value in floats.items()}
        tables = {name: getattr(self, name) for name in tables_of(type(self))}
        values |= {name: several(len(rows), "row") for name, rows in tables.items() if rows is not None and len(rows)}
        lines = "".join(f"<tr><th>{name}</th><td>{escape(str(value))}</td></tr>" for name, value in values.items())
        return f"<table><caption>{self.kind}</caption>{lines}</table>"

    def __post_init__(self) -> None:
        for name in attributes_of(type(self)):
            value = getattr(self, name)
            if not isinstance(value, ATTRIBUTE_TYPES):
                raise ArtifactError(f"{self.kind}.{name} is {value!r}, not a text, number or truth value")
        for name in tables_of(type(self)):
            value = getattr(self, name)
            if not isinstance(value, Table) and not (value is None and may_be_absent(type(self), name)):
                raise ArtifactError(f"{self.kind}.{name} is {type(value).__name__}, not a table")
        self._check_references()

    def _check_references(self) -> None:
        for name in tables_of(type(self)):
            rows = getattr(self, name)
            if rows is None:
                continue
            for column_name, declared in columns_of(type(rows)).items():
                if not declared.refers:
                    continue
                target = getattr(self, declared.refers)
                values = getattr(rows, column_name)
                lowest = -1 if declared.optional else 0
                if values.size and (values.min() < lowest or values.max() >= len(target)):
                    raise ArtifactError(
                        f"{self.kind}.{name}.{column_name} points at row {int(values.max())} or {int(values.min())} of "
                        f"{declared.refers}, which has {several(len(target), 'row')}"
                    )

    def metrics(self) -> dict[str, float | int | None]:
        """Figures of `aatri metrics`: name -> value, None for what was not determined."""
        return {}

    def offers(self) -> tuple[Offer, ...]:
        """What it holds that is to have an effect, see `tables.offers`."""
        return ()

    @classmethod
    def offered_names(cls) -> frozenset[str]:
        """All names under which the kind may offer something."""
        return frozenset()


def _has_rows(values: npt.NDArray[Any], declared: Column) -> bool:
    """Whether an array has a value for every row, or one that stands for all."""
    return values.ndim > len(declared.shape) or not values.size


def _of_rows(values: npt.NDArray[Any] | None, declared: Column, n: int) -> npt.NDArray[Any]:
    """A column of n rows from what is stated of it: values, one value, or nothing."""
    values = np.asarray(declared.default, DTYPES.get(declared.dtype)) if values is None else values
    if not values.size:
        return np.zeros((0, *declared.shape), DTYPES.get(declared.dtype, "U1"))
    return values if _has_rows(values, declared) else np.broadcast_to(values, (n, *declared.shape))


def _computed_once(function: F) -> F:
    """A function of a class, kept by class; `cache` alone hides its types."""
    return cast(F, cache(function))


@_computed_once
def columns_of(cls: type[Table]) -> Mapping[str, Column]:
    """The declared columns of a table, in order."""
    return {f.name: f.metadata["column"] for f in dataclasses.fields(cls) if "column" in f.metadata}


@_computed_once
def may_be_absent(cls: type[Table] | type[Artifact], name: str) -> bool:
    """Whether a column of a table, or a table of an artifact, need not be given."""
    return any(f.name == name and f.default is None for f in dataclasses.fields(cls))


@_computed_once
def attributes_of(cls: type[Artifact]) -> Mapping[str, Attribute]:
    """The declared attributes of an artifact, in order."""
    return {f.name: f.metadata["attribute"] for f in dataclasses.fields(cls) if "attribute" in f.metadata}


@_computed_once
def tables_of(cls: type[Artifact]) -> Mapping[str, type[Table]]:
    """The declared tables of an artifact, in order."""
    import typing

    hints = typing.get_type_hints(cls)
    tables = {}
    for f in dataclasses.fields(cls):
        if "table" in f.metadata:
            kinds = [k for k in (typing.get_args(hints[f.name]) or (hints[f.name],)) if k is not type(None)]
            tables[f.name] = kinds[0]
    return tables


def rows_of(artifact: Artifact) -> dict[str, int]:
    """Rows of each table that is there."""
    tables = {name: getattr(artifact, name) for name in tables_of(type(artifact))}
    return {name: len(rows) for name, rows in tables.items() if rows is not None}


def size_of(artifact: Artifact) -> int:
    """Bytes of all columns."""
    tables = [getattr(artifact, name) for name in tables_of(type(artifact))]
    columns = [getattr(rows, name) for rows in tables if rows is not None for name in columns_of(type(rows))]
    return sum(int(column.nbytes) for column in columns)
