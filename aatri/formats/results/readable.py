"""Tables of an artifact as a reader wants them: ids for rows, one number a column, the worst first, units in the head.

Columns are called as in exported CSV files. `suspects`, `residuals`, `tests` come largest first, measured in standard
deviations; parameters of cameras before those of single images; all else keeps its order. A covariance is shown as
standard deviations, a rotation as omega, phi and kappa. What is not determined is None.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float, Int
from aatri.artifacts.residuals import Residuals, Tests
from aatri.artifacts.solution import ImageOrientations, Parameters, Solution
from aatri.artifacts.suspects import Suspects
from aatri.codes import WORDS_OF_PLACES, WORDS_OF_ROLES, WORDS_OF_USES
from aatri.errors import SpecError
from aatri.formats.results.column_names import (
    ANGLES,
    SIGMAS_M,
    angle_sigmas_deg,
    named,
    parameter_units,
    standard_deviations,
)
from aatri.formats.results.interior_orientation import interior_sigmas
from aatri.geometry.rotations import angles_from_rotation
from aatri.ids import did_you_mean
from aatri.tables.checked_column import Column
from aatri.tables.schema import Artifact, Table, columns_of, tables_of

_SYSTEM = "omega-phi-kappa"
_HIDDEN = ("file", "line", "row")
_HOW = {
    "tests": "set `reliability: true` in the stage",
    "proposed_numbers": "only a search for gross errors proposes numbers: `blunders` other than none",
    "uncontrolled": "it takes standard deviations, and no down-weighted observations",
    "variance_components": "set `variance_components: {groups: [kind]}` in the stage",
}
_WORDS = {"position_use": WORDS_OF_USES, "angle_use": WORDS_OF_USES, "refers_to": WORDS_OF_PLACES}
"""Words of exterior.csv for the codes of a column."""


@dataclass(frozen=True)
class Readable:
    """Rows of a table to be shown."""

    head: tuple[str, ...]
    """Names of the columns."""
    units: tuple[str, ...]
    columns: tuple[list[Any], ...]
    """Values per column: text, number, truth value or None."""
    left_off: int
    """Rows that were not taken."""

    def rows(self) -> list[tuple[Any, ...]]:
        """The rows."""
        return list(zip(*self.columns)) if self.columns else []


def readable(artifact: Artifact, name: str, most: int | None = None) -> Readable:
    """A table of an artifact.

    Parameters
    ----------
    name : str
        Of the table.
    most : int, optional
        So many rows at most.

    Raises
    ------
    SpecError
        If the artifact has no such table.
    """
    tables = tables_of(type(artifact))
    rows = getattr(artifact, name) if name in tables else None
    if rows is None:
        there = [table for table in tables if getattr(artifact, table) is not None]
        what = f"no values of {name!r}" if name in tables else f"no table {name!r}{did_you_mean(name, tables)}"
        remedy = _HOW.get(name, "")
        raise SpecError(f"{artifact.kind}: {what}; it has {', '.join(there)}", remedy=remedy)
    by_name = _columns(artifact, rows)
    if isinstance(artifact, Solution) and name == "tests":
        shared = _columns(artifact, artifact.residuals)
        by_name = {k: shared[k] for k in ("kind", "image", "point")} | by_name | {"unit": shared["unit"]}
    if isinstance(artifact, Solution) and name == "cameras":
        by_name |= {column: ("mm", _plain(values)) for column, values in interior_sigmas(artifact).items()}
    if isinstance(artifact, Solution) and name == "parameters":
        by_name["unit"] = ("", parameter_units(artifact))
    order = _order(rows)
    taken = order if most is None else order[:most]
    columns = {key: (unit, [values[k] for k in taken.tolist()]) for key, (unit, values) in by_name.items()}
    columns = {
        key: column for key, column in columns.items() if key == "kind" or any(v not in (None, "") for v in column[1])
    }
    return Readable(
        tuple(columns),
        tuple(unit for unit, _ in columns.values()),
        tuple(values for _, values in columns.values()),
        len(order) - len(taken),
    )


def _columns(artifact: Artifact, rows: Table) -> dict[str, tuple[str, list[Any]]]:
    """Unit and values by name."""
    by_name: dict[str, tuple[str, list[Any]]] = {}
    for name, declared in columns_of(type(rows)).items():
        if name not in _HIDDEN:
            by_name |= _column(artifact, rows, name, declared, getattr(rows, name))
    return by_name


def _column(
    artifact: Artifact, rows: Table, name: str, declared: Column, values: npt.NDArray[Any]
) -> dict[str, tuple[str, list[Any]]]:
    unit = "" if declared.unit.startswith("see ") else declared.unit
    if declared.refers:
        target = getattr(artifact, declared.refers)
        if "id" in columns_of(type(target)):
            ids = [*target.id.tolist(), ""]
            return {name: ("", [ids[k] for k in values.tolist()])}
    if name == "role":
        return {
            f"role_{a}": ("", [WORDS_OF_ROLES[code] for code in values[:, k].tolist()]) for k, a in enumerate("xyz")
        }
    if name in _WORDS:
        return {name: ("", [_WORDS[name][code] for code in values.tolist()])}
    if name == "ground_from_image":
        angles = np.degrees(angles_from_rotation(values, _SYSTEM))
        return {angle: ("deg", _plain(angles[:, k])) for k, angle in enumerate(ANGLES[_SYSTEM])}
    if "covariance" not in name or len(declared.shape) != 2:
        return {column: (unit, _plain(part)) for column, part in named(rows, name).items()}
    sigmas = standard_deviations(values)
    in_metres = SIGMAS_M if unit in ("m^2", "m and rad") else ()
    shown = {column: ("m", _plain(sigmas[:, k])) for k, column in enumerate(in_metres)}
    if isinstance(rows, ImageOrientations):
        angles_deg = angle_sigmas_deg(rows, _SYSTEM)
        return shown | {column: ("deg", _plain(part)) for column, part in angles_deg.items()}
    return shown or {f"s{k + 1}": ("", _plain(sigmas[:, k])) for k in range(sigmas.shape[1])}


def _plain(values: npt.NDArray[Any]) -> list[Any]:
    listed: list[Any] = values.tolist()
    return [None if v != v else v for v in listed] if values.dtype.kind == "f" else listed


def _order(rows: Table) -> Int:
    """Rows in the order to be shown: the largest first where there is a measure, the untested last."""
    measure: Float | None = None
    if isinstance(rows, Suspects):
        measure = np.abs(rows.test)
    elif isinstance(rows, Residuals):
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(rows.sigma > 0, np.abs(rows.residual) / rows.sigma, np.nan)
        measure = np.fmax.reduce(ratio, axis=1)
    elif isinstance(rows, Tests):
        measure = np.fmax.reduce(np.abs(rows.test), axis=1)
    if isinstance(rows, Parameters):
        measure = (rows.group != "film").astype(np.float64)
    if measure is None:
        return np.arange(len(rows))
    return np.argsort(np.where(np.isfinite(measure), -measure, np.inf), kind="stable")


def as_records(table: Readable) -> list[dict[str, Any]]:
    """The rows by name, as JSON has them."""
    return [dict(zip(table.head, row)) for row in table.rows()]
