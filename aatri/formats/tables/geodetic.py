"""geodetic.csv as a table: metres and radians, in canonical order.

`value` and `sigma` are in the block's ground or angle unit, whichever the type of the observation has. An observation
from a station to itself, or a distance that is not positive, is set aside with its reason.
"""

from collections.abc import Iterable
from typing import Any

import numpy as np

from aatri.arrays import Float
from aatri.formats.tables.columns import GEODETIC
from aatri.formats.tables.covariances import geodetic_covariances
from aatri.formats.tables.source import Source, ask_for_angle_unit, choice, look_up, plain_angle_rad, rad_of
from aatri.formats.text.csv_table import CsvTable
from aatri.formats.text.number_text import number_of

ANGLES = ("direction", "azimuth", "angle", "zenith")
DISTANCES = ("distance", "horizontal_distance")
TYPES = (*DISTANCES, *ANGLES, "height_difference", "dX", "dY", "dZ")


def geodetic_columns(
    source: Source, images: Iterable[str], points: Iterable[str], covariances: CsvTable | None
) -> tuple[dict[str, Any], dict[str, Any]]:
    """geodetic.csv and covariances of its rows; nothing where there are none, or faults, which are kept."""
    table = source.table("geodetic.csv")
    if table is None:
        return {}, {}
    types = choice(table, "type", TYPES, "")
    kinds = {end: choice(table, f"{end}_kind", ("point", "image"), "point") for end in ("from", "to")}
    _check_ids(table, kinds, list(images), list(points))
    _check_types(table, types)
    _check_axes(source, table, types)
    value, sigma = _values(source, table, types, "value"), _values(source, table, types, "sigma")
    table.complain(np.flatnonzero(sigma <= 0), "sigma", "sigma is {}", "a standard deviation is more than 0")
    if source.problems:
        return {}, {}
    columns = source.columns(table, GEODETIC)
    columns |= {"type": [_own_axis(source, t) for t in types], "value": value, "sigma": sigma}
    unit = np.array([_unit(source, t) for t in types])
    return columns, geodetic_covariances(source, covariances, len(table), unit)


def _check_ids(table: CsvTable, kinds: dict[str, list[str]], images: list[str], points: list[str]) -> None:
    row_of = {"point": {name: k for k, name in enumerate(points)}, "image": {name: k for k, name in enumerate(images)}}
    for end in ("from", "to"):
        for kind in ("point", "image"):
            chosen = [cell if kinds[end][k] == kind else "" for k, cell in enumerate(table.text[end])]
            part = CsvTable(table.path, table.header, table.line, {end: chosen}, {}, table.source, table.problems)
            look_up(
                part,
                end,
                row_of[kind],
                f"station ({kind})",
                "add it to ground_points.csv (empty coordinates will do), or set from_kind, to_kind",
            )
    look_up(table, "via", row_of["point"], "station", "add it to ground_points.csv (empty coordinates will do)")


def _check_types(table: CsvTable, types: list[str]) -> None:
    via, sets = table.text["via"], table.text["set"]
    table.complain(
        [k for k, t in enumerate(types) if t == "angle" and not via[k]],
        "via",
        "an angle needs `via`",
        "name the vertex",
    )
    table.complain(
        [k for k, t in enumerate(types) if t == "direction" and not sets[k]],
        "set",
        "a direction needs `set`",
        "name the set: its directions share an orientation",
    )


def _check_axes(source: Source, table: CsvTable, types: list[str]) -> None:
    """In a frame in degrees there are no axes and no map for what is counted in them."""
    if not source.default_frame:
        return
    rows = [k for k, t in enumerate(types) if t in ("dX", "dY", "azimuth")]
    table.complain(
        rows,
        "type",
        "{} is counted in the axes of the first frame, which is in degrees",
        "make a map, or a geocentric frame, the first one",
    )
    rows = [k for k, cell in enumerate(table.text["reduced"]) if cell == "map"]
    table.complain(rows, "reduced", "reduced to a map, but the first frame is in degrees", "make the map the first one")


def _values(source: Source, table: CsvTable, types: list[str], column: str) -> Float:
    """Values in m or rad, by type."""
    units = source.settings.units
    values = np.full(len(table), np.nan)
    bad = []
    for k, cell in enumerate(table.text[column]):
        try:
            values[k] = rad_of(cell, units.angle) if types[k] in ANGLES else number_of(cell) * units.ground_m
        except ValueError:
            if cell:
                bad.append(k)
    in_units = {True: f"angles are in {units.angle or 'units.angle'}", False: "lengths are in units.ground"}
    for angle, unit in in_units.items():
        rows_of_kind = [k for k in bad if (types[k] in ANGLES) == angle]
        table.complain_of_numbers(rows_of_kind, column, unit)
    if any(t in ANGLES for t in types):
        ask_for_angle_unit(source, "geodetic.csv has angles", "units")
    return values


def _own_axis(source: Source, kind: str) -> str:
    """dX, dY of a table with axes north, east, up are dY, dX of the right-handed axes."""
    if kind not in ("dX", "dY", "dZ"):
        return kind
    return "d" + right_handed_axis(source, kind[1])


def right_handed_axis(source: Source, axis: str) -> str:
    """The axis of the Block that the tables call X, Y or Z."""
    name = list(source.settings.frames.values())[source.default_frame].axes["XYZ".index(axis)]
    axis_letter = {"east": "X", "north": "Y", "up": "Z", "longitude": "X", "latitude": "Y", "height": "Z"}
    return axis_letter.get(name, name.upper())


def _unit(source: Source, kind: str) -> float:
    units = source.settings.units
    return plain_angle_rad(source) if kind in ANGLES else units.ground_m
