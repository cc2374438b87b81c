"""Tables of artifacts as DataFrames, and as HTML for notebooks."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

from aatri.errors import InputError
from aatri.tables.schema import Artifact


def to_dataframe(artifact: Artifact, table: str) -> Any:
    """A table of an artifact as a DataFrame of pandas, or of polars where there is no pandas.

    Rows are told by ids, columns are called as in `aatri show` and exported CSV files; `suspects`, `residuals` and
    `tests` come largest first. The units of the columns stand in `attrs["units"]` of a pandas frame.

    Parameters
    ----------
    table : str
        Name of one of its tables: points, images, residuals ...

    Raises
    ------
    SpecError
        If the artifact has no such table.
    InputError
        If neither pandas nor polars is installed.
    """
    from aatri.formats.results.readable import readable

    shown = readable(artifact, table)
    units = {name: unit for name, unit in zip(shown.head, shown.units) if unit}
    return frame_of(dict(zip(shown.head, shown.columns)), units)


def frame_of(columns: Mapping[str, list[Any]], units: Mapping[str, str]) -> Any:
    """Columns as a DataFrame of what is installed.

    Raises
    ------
    InputError
        If neither pandas nor polars is.
    """
    try:
        import pandas
    except ImportError:
        pass
    else:
        frame = pandas.DataFrame(columns)
        frame.attrs["units"] = dict(units)
        return frame
    try:
        import polars
    except ImportError:
        remedy = "pip install 'aatri[pandas]'"
        raise InputError("neither pandas nor polars is installed", remedy=remedy) from None
    return polars.DataFrame(columns)


def html_table(head: Sequence[str], rows: Iterable[Sequence[object]], caption: str = "") -> str:
    """A table as notebooks show it."""

    def line(cells: Sequence[object], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{escape(str(cell))}</{tag}>" for cell in cells) + "</tr>"

    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    body = "".join(line(row, "td") for row in rows)
    return f"<table>{title}<thead>{line(head, 'th')}</thead><tbody>{body}</tbody></table>"


def number(value: object) -> str:
    """A figure as text."""
    return "-" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
