"""A Block from arrays or DataFrames: the tables of a block folder, without the folder."""

import csv
import inspect
import tempfile
import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from aatri.artifacts.block import Block
from aatri.errors import AatriError, Errors, SpecError
from aatri.ids import did_you_mean
from aatri.progress import Silent

TABLES = ("images", "image_points", "ground_points", "exterior", "fiducials", "geodetic", "covariances")


class Warned(Silent):
    """A context that turns what a stage warns of into Python's warnings."""

    def warn(self, message: str) -> None:
        """Take a warning, as of the line outside of aatri that called."""
        frame, level = inspect.currentframe(), 1
        while frame is not None and frame.f_globals.get("__name__", "").startswith("aatri."):
            frame, level = frame.f_back, level + 1
        warnings.warn(message, UserWarning, stacklevel=level)


def block_from(settings: Mapping[str, Any], **tables: Any) -> Block:
    """A Block from what block.yaml says and from tables with the columns of its CSV files (docs/formats.md).

    Parameters
    ----------
    settings : mapping
        What block.yaml holds: name, frames, units, sigma, cameras ...; `aatri_block` may be left out.
    **tables
        images, image_points, ground_points, exterior, fiducials, geodetic, covariances: each a DataFrame, or a mapping
        of str to array, one array a column. Missing values (None, NaN) are empty cells.

    Raises
    ------
    SpecError
        If there is no such table.
    InputError
        Whatever is wrong with the tables, all at once; rows count from line 2, as in a file with a header.

    Examples
    --------
    >>> camera = {"kind": "film", "image_coordinates": "photo", "principal_distance": 152.0, "format": [230, 230]}
    >>> settings = {
    ...     "name": "pair",
    ...     "frames": {"map": {"axes": ["east", "north", "up"], "crs": "local"}},
    ...     "units": {"ground": "m", "sigma_image": "mm", "sigma_ground": "m"},
    ...     "sigma": {"image": 0.005},
    ...     "cameras": {"c": camera},
    ... }
    >>> block = block_from(
    ...     settings,
    ...     images={"image": ["left", "right"], "camera": ["c", "c"]},
    ...     image_points={"image": ["left", "right"], "point": ["1", "1"], "x": [12.5, -80.1], "y": [3.2, 3.3]},
    ... )
    >>> block.images.id.tolist(), block.image_points.xy.tolist()
    (['left', 'right'], [[12.5, 3.2], [-80.1, 3.3]])
    """
    import yaml

    from aatri.formats.tables.reader import read_block

    for name in tables:
        if name not in TABLES:
            raise SpecError(f"no table {name!r}{did_you_mean(name, TABLES)}", remedy=f"tables are {', '.join(TABLES)}")
    with tempfile.TemporaryDirectory() as folder:
        text = yaml.safe_dump({"aatri_block": 1, **settings}, sort_keys=False, allow_unicode=True)
        Path(folder, "block.yaml").write_text(text, encoding="utf-8")
        for name, table in tables.items():
            with Path(folder, f"{name}.csv").open("w", encoding="utf-8", newline="") as file:
                writer = csv.writer(file, lineterminator="\n")
                columns = {str(column): table[column] for column in table}
                writer.writerow(columns)
                writer.writerows(zip(*(_cells(column) for column in columns.values()), strict=True))
        try:
            return read_block(Path(folder), Warned())
        except AatriError as error:
            raise _without(folder, error) from None


def _cells(values: Iterable[Any]) -> list[Any]:
    listed = values.tolist() if hasattr(values, "tolist") else list(values)
    return ["" if value is None or value != value else value for value in listed]


def _without(folder: str, error: AatriError) -> AatriError:
    """The error with names of tables only: the folder is gone."""
    if isinstance(error, Errors):
        return Errors([_without(folder, one) for one in error.errors])
    texts = [text.replace(f"{folder}/", "") for text in (error.what, error.where, error.remedy)]
    return type(error)(texts[0], where=texts[1], remedy=texts[2])
