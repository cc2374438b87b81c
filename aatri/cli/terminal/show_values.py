"""Values of a table, as `aatri show RUN:STAGE TABLE` prints them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from aatri.cli.terminal.console import narrate, say_json, say_table
from aatri.errors import ArtifactError
from aatri.ids import several


def say_values(path: Path, kind: str, table: str, most: int | None, *, json: bool) -> None:
    """Print the rows of a table of an artifact.

    Parameters
    ----------
    most : int, optional
        So many rows, the rest is counted; None: all.
    """
    from aatri.artifacts.kinds import KINDS
    from aatri.formats.results.column_names import sigma_columns
    from aatri.formats.results.readable import as_records, readable
    from aatri.tables.hdf5 import read

    if kind not in KINDS:
        raise ArtifactError(f"an artifact of kind {kind!r}", where=str(path), remedy=f"kinds are {', '.join(KINDS)}")
    shown = readable(read(path, KINDS[kind]), table, most)
    if json:
        units = {name: unit for name, unit in zip(shown.head, shown.units) if unit}
        say_json({"table": table, "units": units, "rows": as_records(shown), "left_off": shown.left_off})
        return
    if not shown.rows():
        narrate(_NOTHING.get(table, f"{table}: no rows"))
        return
    head = [f"{name} [{unit}]" if unit else name for name, unit in zip(shown.head, shown.units)]
    numbers = [name for name, column in zip(head, shown.columns) if any(isinstance(v, float | int) for v in column)]
    sigmas = sigma_columns(shown.head)
    say_table(head, [_cells(row, sigmas) for row in as_records(shown)], numbers)
    if shown.left_off:
        narrate(f"{several(shown.left_off, 'more row')}; --all prints them")


TESTS = ("w", "wx", "wy", "wz")
"""In standard deviations of their own."""

_NOTHING = {
    "proposed_numbers": "proposed_numbers: none are proposed",
    "uncontrolled": "uncontrolled: none, every observation is controlled",
    "suspects": "suspects: none",
}


def _cells(row: Mapping[str, Any], sigmas: Mapping[str, str]) -> list[str]:
    """A row as text: to two digits of its standard deviation what has one, tests to a hundredth, else to six digits."""
    from aatri.report.view.numbers import rounded

    cells = []
    for name, value in row.items():
        sigma = row[sigmas[name]] if name in sigmas else None
        if isinstance(value, float) and isinstance(sigma, float) and sigma > 0:
            cells.append(rounded(value, sigma))
        else:
            cells.append(f"{value:.2f}" if name in TESTS and value is not None else cell(value))
    return cells


def cell(value: Any) -> str:
    """A value as text: six digits, large numbers to four decimals, `-` if it was not determined."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not isinstance(value, float):
        return str(value)
    return f"{value:.6g}" if abs(value) < 1e5 else f"{value:.4f}"
