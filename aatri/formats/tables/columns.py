"""The tables of the block folder, column by column: what cells are there, and the column of the Block that they fill.

The one declaration from which tables are read and written, and which docs/formats.md is held against. A column without
a `field` is more than a cell for a value: coordinates in any frame, roles, angles; readers and the writer make it.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from aatri.codes import WORDS_OF_PLACES
from aatri.formats.text.csv_table import CsvColumn

ID, OPTIONAL_ID, TEXT, NUMBER = CsvColumn("id", "cell"), CsvColumn("id"), CsvColumn("text"), CsvColumn("number")
NEEDED_NUMBER, NUMBER_COLUMN, NEEDED_TEXT = (
    CsvColumn("number", "cell"),
    CsvColumn("number", "column"),
    CsvColumn("text", "cell"),
)


class Stated(NamedTuple):
    """A column of a table."""

    cell: CsvColumn
    """What its cells may be, and whether they must be there."""
    field: str = ""
    """The column of the Block's table; empty: made otherwise."""
    part: int | None = None
    """The component of a field with several."""
    unit: str = ""
    """Unit of block.yaml whose factor brings a number to that of the Block; `angle`, or `type` where it depends on the
    type of the observation: a text that the reader makes a number of."""
    words: Mapping[str, Any] = MappingProxyType({})
    """What the words of a text stand for; the first is that of an empty cell."""
    empty: bool | None = None
    """Of a column of yes and no: what an empty cell is."""


COORDINATES, SIGMAS, COVARIANCES = ("X", "Y", "Z"), ("sX", "sY", "sZ"), {"sXY": (0, 1), "sXZ": (0, 2), "sYZ": (1, 2)}
_PRECISION = {name: Stated(NUMBER) for name in (*SIGMAS, *COVARIANCES)}
_FIGURES = {
    "x": Stated(NEEDED_NUMBER, "xy", 0),
    "y": Stated(NEEDED_NUMBER, "xy", 1),
    "sx": Stated(NUMBER, "sigma_mm", 0),
    "sy": Stated(NUMBER, "sigma_mm", 1),
}
_ENDS = {word: word for word in ("point", "image")}
_REDUCED = {word: word for word in ("no", "horizon", "ellipsoid", "map")}

IMAGES = {
    "image": Stated(ID, "id"),
    "camera": Stated(ID, "camera"),
    "strip": Stated(OPTIONAL_ID, "strip"),
    "sequence": Stated(NUMBER, "sequence"),
    "time": Stated(NUMBER, "time_s", unit="time_s"),
    **{name: Stated(TEXT, name) for name in ("flight", "session", "rig", "member", "path", "mask")},
}
IMAGE_POINTS = {
    "image": Stated(ID, "image"),
    "point": Stated(ID, "point"),
    **_FIGURES,
    "group": Stated(TEXT, "group"),
    "active": Stated(TEXT, "active", empty=True),
    "row_time": Stated(NUMBER, "row_time_s", unit="time_s"),
}
FIDUCIALS = {"image": Stated(ID, "image"), "fiducial": Stated(ID, "fiducial"), **_FIGURES}
GROUND_POINTS = {
    "point": Stated(ID, "point"),
    **{name: Stated(NUMBER_COLUMN) for name in COORDINATES},
    **_PRECISION,
    "role": Stated(TEXT),
    "datum": Stated(TEXT, "datum", empty=False),
    "frame": Stated(TEXT),
}
EXTERIOR = {
    "image": Stated(ID, "image"),
    **{name: Stated(NUMBER) for name in COORDINATES},
    **_PRECISION,
    **{f"a{k + 1}": Stated(TEXT, "angles_rad", k, "angle") for k in range(3)},
    **{f"s{k + 1}": Stated(NUMBER, "angle_sigma_rad", k) for k in range(3)},
    "use": Stated(TEXT),
    "refers_to": Stated(TEXT, "refers_to", words={word: code for code, word in WORDS_OF_PLACES.items()}),
    "frame": Stated(TEXT),
    "drift_group": Stated(TEXT, "drift_group"),
}
GEODETIC = {
    "type": Stated(NEEDED_TEXT),
    "from": Stated(ID, "start"),
    "to": Stated(ID, "end"),
    **{name: Stated(NEEDED_TEXT, name, unit="type") for name in ("value", "sigma")},
    "via": Stated(OPTIONAL_ID, "via"),
    "from_kind": Stated(TEXT, "start_kind", words=_ENDS),
    "to_kind": Stated(TEXT, "end_kind", words=_ENDS),
    "set": Stated(TEXT, "set"),
    "group": Stated(TEXT, "group"),
    "h_from": Stated(NUMBER, "start_height_m", unit="ground_m"),
    "h_to": Stated(NUMBER, "end_height_m", unit="ground_m"),
    "active": Stated(TEXT, "active", empty=True),
    "reduced": Stated(TEXT, "reduced", words=_REDUCED),
}
COVARIANCE_ROWS = {
    "table": Stated(NEEDED_TEXT),
    "row_a": Stated(ID),
    "row_b": Stated(ID),
    "value": Stated(NEEDED_NUMBER),
    "coord_a": Stated(TEXT),
    "coord_b": Stated(TEXT),
}

TABLES: dict[str, dict[str, Stated]] = {
    "images.csv": IMAGES,
    "image_points.csv": IMAGE_POINTS,
    "fiducials.csv": FIDUCIALS,
    "ground_points.csv": GROUND_POINTS,
    "exterior.csv": EXTERIOR,
    "geodetic.csv": GEODETIC,
    "covariances.csv": COVARIANCE_ROWS,
}
"""Of each file its columns, those that must be there first."""


def components(columns: Mapping[str, Stated], values: Mapping[str, Any]) -> dict[str, Any]:
    """Columns of the Block from those of a table, components side by side."""
    by_field: dict[str, Any] = {}
    for name, column in columns.items():
        if column.part is None:
            by_field[column.field] = values[name]
        elif column.part == 0:
            parts = [other for other, one in columns.items() if one.field == column.field]
            by_field[column.field] = np.stack([values[part] for part in parts], axis=1)
    return by_field
