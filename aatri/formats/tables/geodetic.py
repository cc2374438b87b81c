"""geodetic.csv as a table: metres and radians, in canonical order.

`value` and `sigma` are in the block's ground or angle unit, whichever the type of the observation has. An observation
from a station to itself, or a distance that is not positive, is set aside with its reason.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from aatri.arrays import Float, Int
from aatri.artifacts.block import Geodetic, GeodeticCovariances
from aatri.errors import InputError
from aatri.formats.tables.covariances import geodetic_covariances
from aatri.formats.tables.source import Source, choice, look_up, plain_angle_rad, rad_of, texts, yes_no
from aatri.formats.text.csv_table import Column, CsvTable
from aatri.formats.text.number_text import number_of

ID, TEXT, NUMBER = Column("id", "cell"), Column("text"), Column("number")

ANGLES = ("direction", "azimuth", "angle", "zenith")
DISTANCES = ("distance", "horizontal_distance")
TYPES = (*DISTANCES, *ANGLES, "height_difference", "dX", "dY", "dZ")
REDUCED = ("no", "horizon", "ellipsoid", "map")

GEODETIC = {
    "type": Column("text", "cell"), "from": ID, "to": ID, "value": Column("text", "cell"),
    "sigma": Column("text", "cell"), "via": Column("id"), "from_kind": TEXT, "to_kind": TEXT, "set": TEXT,
    "group": TEXT, "h_from": NUMBER, "h_to": NUMBER, "active": TEXT, "reduced": TEXT,
}  # fmt: skip


class GeodeticTables(NamedTuple):
    """Geodetic observations and their covariances."""

    geodetic: Geodetic
    covariances: GeodeticCovariances


def geodetic_tables(
    source: Source, images: Iterable[str], points: Iterable[str], covariances: CsvTable | None
) -> GeodeticTables:
    """Geodetic observations in canonical order, with their covariances."""
    nothing = GeodeticTables(Geodetic.empty(), GeodeticCovariances.empty())
    table = source.table("geodetic.csv", GEODETIC)
    if table is None:
        return nothing
    types = choice(table, "type", TYPES, "")
    kinds = {end: choice(table, f"{end}_kind", ("point", "image"), "point") for end in ("from", "to")}
    _check_ids(table, kinds, list(images), list(points))
    _check_types(table, types)
    _check_axes(source, table, types)
    value, sigma = _values(source, table, types, "value"), _values(source, table, types, "sigma")
    table.complain(np.flatnonzero(sigma <= 0), "sigma", "sigma is {}", "a standard deviation is more than 0")
    if source.problems:
        return nothing
    units = source.settings.units
    rows = Geodetic(
        type=texts(_own_axis(source, t) for t in types), start=texts(table.text["from"]), end=texts(table.text["to"]),
        via=texts(table.text["via"]), start_kind=texts(kinds["from"]), end_kind=texts(kinds["to"]), value=value,
        sigma=sigma, set=texts(table.text["set"]), group=texts(table.text["group"]),
        start_height_m=table.number["h_from"] * units.ground_m, end_height_m=table.number["h_to"] * units.ground_m,
        active=yes_no(table, "active", True), reduced=texts(choice(table, "reduced", REDUCED, "no")),
        file=source.file("geodetic.csv", len(table)), line=table.line,
    )  # fmt: skip
    order = geodetic_order(rows)
    unit = np.array([_unit(source, t) for t in types])
    correlated = geodetic_covariances(source, covariances, rows, unit, order)
    return GeodeticTables(rows.take(order), correlated)


def _check_ids(table: CsvTable, kinds: dict[str, list[str]], images: list[str], points: list[str]) -> None:
    known = {"point": {name: k for k, name in enumerate(points)}, "image": {name: k for k, name in enumerate(images)}}
    for end in ("from", "to"):
        for kind in ("point", "image"):
            chosen = [cell if kinds[end][k] == kind else "" for k, cell in enumerate(table.text[end])]
            part = CsvTable(table.path, table.header, table.line, {end: chosen}, {}, table.source, table.problems)
            look_up(part, end, known[kind], f"station ({kind})",
                    "add it to ground_points.csv (empty coordinates will do), or set from_kind, to_kind")  # fmt: skip
    look_up(table, "via", known["point"], "station", "add it to ground_points.csv (empty coordinates will do)")


def _check_types(table: CsvTable, types: list[str]) -> None:
    via, sets = table.text["via"], table.text["set"]
    table.complain([k for k, t in enumerate(types) if t == "angle" and not via[k]], "via", "an angle needs `via`",
                   "name the vertex")  # fmt: skip
    table.complain([k for k, t in enumerate(types) if t == "direction" and not sets[k]], "set",
                   "a direction needs `set`", "name the set: its directions share an orientation")  # fmt: skip


def _check_axes(source: Source, table: CsvTable, types: list[str]) -> None:
    """In a frame in degrees there are no axes and no map for what is counted in them."""
    if not source.default_frame:
        return
    rows = [k for k, t in enumerate(types) if t in ("dX", "dY", "azimuth")]
    table.complain(rows, "type", "{} is counted in the axes of the first frame, which is in degrees",
                   "make a map, or a geocentric frame, the first one")  # fmt: skip
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
        some = [k for k in bad if (types[k] in ANGLES) == angle]
        table.complain(some, column, f"{column} is {{}}, not a number", unit)
    if units.angle is None and any(t in ANGLES for t in types):
        source.problems.append(InputError("units.angle is missing, but geodetic.csv has angles",
                                          where=source.document.where("units"),
                                          remedy="add units: {angle: gon} (or deg, rad, dms)"))  # fmt: skip
    return values


def _own_axis(source: Source, kind: str) -> str:
    """dX, dY of a table with axes north, east, up are dY, dX of the right-handed axes."""
    if kind not in ("dX", "dY", "dZ"):
        return kind
    return "d" + right_handed_axis(source, kind[1])


def right_handed_axis(source: Source, axis: str) -> str:
    """The axis of the Block that the tables call X, Y or Z."""
    name = list(source.settings.frames.values())[source.default_frame].axes["XYZ".index(axis)]
    known = {"east": "X", "north": "Y", "up": "Z", "longitude": "X", "latitude": "Y", "height": "Z"}
    return known.get(name, name.upper())


def geodetic_order(rows: Geodetic) -> Int:
    """The canonical order: by type, set, via, start, end, and the figures."""
    names = ("type", "set", "via", "start", "end", "start_kind", "end_kind", "group", "reduced")
    columns = [[str(text).encode() for text in getattr(rows, name)] for name in names]
    figures = [np.nan_to_num(getattr(rows, name), nan=-1.0).tolist()
               for name in ("value", "sigma", "start_height_m", "end_height_m")]  # fmt: skip
    keys = list(zip(*columns, *figures))
    return np.array(sorted(range(len(rows)), key=lambda k: keys[k]), dtype=np.intp)


def _unit(source: Source, kind: str) -> float:
    units = source.settings.units
    return plain_angle_rad(source) if kind in ANGLES else units.ground_m
