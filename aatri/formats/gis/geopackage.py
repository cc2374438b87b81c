"""Writing of layers as a GeoPackage 1.3, with the styles of QGIS in `layer_styles`.

A GeoPackage is an SQLite file: tables of coordinate systems, contents and geometry columns, a table a layer, geometries
as WKB behind a header. Coordinates are those of the block; a local block is in the undefined Cartesian system. Styles
are as QGIS keeps them (QML): one symbol a layer, names beside images and control.

Source: OGC 12-128r17, GeoPackage Encoding Standard, 1.1 and 2.1; QGIS documentation, appendix A, QML; the table
layer_styles of its GeoPackage provider.
"""

import sqlite3
import struct
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from aatri.arrays import Float
from aatri.formats.gis.layers import CARRIES, PAGE, Layer, layers_of
from aatri.formats.parts.block_parts import LOCAL
from aatri.formats.parts.format import AS_USUAL, Format, Writing
from aatri.formats.parts.of_block import frame_of
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.formats.text.written_files import element, write_files, xml_of
from aatri.frames.conversion import Frame, crs_of
from aatri.progress import SILENT, Reporter

NAME = "block.gpkg"
APPLICATION, VERSION = 0x47504B47, 10300
"""GPKG, and 1.3."""
UNDEFINED, OWN = -1, 100_000
"""Numbers of the undefined Cartesian system, and of one that is not of the EPSG."""
WKB = {"Point": 1001, "LineString": 1002, "Polygon": 1003}
"""Types of geometries with heights."""
SQL = {str: "TEXT", int: "INTEGER", float: "REAL"}

TABLES = """
CREATE TABLE gpkg_spatial_ref_sys (srs_name TEXT NOT NULL, srs_id INTEGER NOT NULL PRIMARY KEY,
 organization TEXT NOT NULL, organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL, description TEXT);
CREATE TABLE gpkg_contents (table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL, identifier TEXT UNIQUE,
 description TEXT DEFAULT '', last_change DATETIME NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')),
 min_x DOUBLE, min_y DOUBLE, max_x DOUBLE, max_y DOUBLE, srs_id INTEGER REFERENCES gpkg_spatial_ref_sys(srs_id));
CREATE TABLE gpkg_geometry_columns (table_name TEXT NOT NULL REFERENCES gpkg_contents(table_name),
 column_name TEXT NOT NULL, geometry_type_name TEXT NOT NULL,
 srs_id INTEGER NOT NULL REFERENCES gpkg_spatial_ref_sys(srs_id), z TINYINT NOT NULL,
 m TINYINT NOT NULL, PRIMARY KEY (table_name, column_name));
CREATE TABLE layer_styles (id INTEGER PRIMARY KEY AUTOINCREMENT, f_table_catalog TEXT, f_table_schema TEXT,
 f_table_name TEXT, f_geometry_column TEXT, styleName TEXT, styleQML TEXT, styleSLD TEXT, useAsDefault BOOLEAN,
 description TEXT, owner TEXT, ui TEXT, update_time DATETIME DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')));
"""
WGS84 = (
    'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0],'
    'UNIT["degree",0.0174532925199433],AUTHORITY["EPSG","4326"]]'
)


def write_geopackage(
    oriented: OrientedBlock, folder: Path, writing: Writing = AS_USUAL, reporter: Reporter = SILENT
) -> None:
    """Write `block.gpkg`."""
    layers, system = layers_of(oriented), _system(frame_of(oriented.block))
    with closing(sqlite3.connect(":memory:")) as database:
        with database:
            _write(database, layers, system)
        write_files(folder, {NAME: database.serialize()})


def _system(frame: Frame) -> tuple[str, int, str, int, str]:
    """Name, number, organization and its number, and definition of the coordinate system."""
    if frame == LOCAL:
        return "Undefined Cartesian", UNDEFINED, "NONE", UNDEFINED, "undefined"
    flat = crs_of(Frame(frame.name, frame.axes, frame.crs))
    flat = flat if flat.is_geocentric or flat.is_compound else flat.to_2d()
    code = flat.to_epsg(min_confidence=100)
    try:
        definition = flat.to_wkt("WKT1_GDAL")
    except Exception:  # of pyproj: a system that the old text has no words for
        definition = flat.to_wkt()
    return (flat.name, code, "EPSG", code, definition) if code else (flat.name, OWN, "NONE", OWN, definition)


def _write(database: sqlite3.Connection, layers: Sequence[Layer], system: tuple[str, int, str, int, str]) -> None:
    database.executescript(f"PRAGMA application_id = {APPLICATION}; PRAGMA user_version = {VERSION}; {TABLES}")
    systems = [
        ("Undefined Cartesian", UNDEFINED, "NONE", UNDEFINED, "undefined"),
        ("Undefined geographic", 0, "NONE", 0, "undefined"),
        ("WGS 84", 4326, "EPSG", 4326, WGS84),
        system,
    ]
    rows = {row[1]: row for row in systems}
    database.executemany(
        "INSERT INTO gpkg_spatial_ref_sys (srs_name, srs_id, organization, organization_coordsys_id, definition) "
        "VALUES (?, ?, ?, ?, ?)",
        list(rows.values()),
    )
    for layer in layers:
        _write_layer(database, layer, system[1])
    database.execute(
        "INSERT INTO gpkg_contents (table_name, data_type, identifier) VALUES ('layer_styles', 'attributes', "
        "'layer_styles')"
    )


def _write_layer(database: sqlite3.Connection, layer: Layer, srs: int) -> None:
    columns = "".join(f', "{name}" {SQL[kind]}' for name, kind in layer.fields.items())
    form = layer.geometry.upper()
    database.execute(f'CREATE TABLE "{layer.name}" (fid INTEGER PRIMARY KEY AUTOINCREMENT, geom {form}{columns})')
    low, high = (
        np.min([s.min(axis=0) for s in layer.shapes], axis=0),
        np.max([s.max(axis=0) for s in layer.shapes], axis=0),
    )
    database.execute(
        "INSERT INTO gpkg_contents (table_name, data_type, identifier, min_x, min_y, max_x, max_y, srs_id) "
        "VALUES (?, 'features', ?, ?, ?, ?, ?, ?)",
        (layer.name, layer.name, *low[:2].tolist(), *high[:2].tolist(), srs),
    )
    database.execute("INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', ?, ?, 1, 0)", (layer.name, form, srs))
    names = ", ".join(f'"{name}"' for name in ("geom", *layer.fields))
    marks = ", ".join("?" * (1 + len(layer.fields)))
    rows: list[tuple[Any, ...]] = [
        (blob(layer.geometry, shape, srs), *row) for shape, row in zip(layer.shapes, layer.rows)
    ]
    database.executemany(f'INSERT INTO "{layer.name}" ({names}) VALUES ({marks})', rows)
    database.execute(
        "INSERT INTO layer_styles (f_table_catalog, f_table_schema, f_table_name, f_geometry_column, styleName, "
        "styleQML, useAsDefault, description, owner) VALUES ('', '', ?, 'geom', ?, ?, 1, '', '')",
        (layer.name, layer.name, style_of(layer.name)),
    )


def blob(geometry: str, shape: Float, srs: int) -> bytes:
    """A geometry with its header: little-endian, without an envelope."""
    vertices = np.ascontiguousarray(shape, dtype="<f8").tobytes()
    counts = {"Point": b"", "LineString": struct.pack("<I", len(shape)), "Polygon": struct.pack("<II", 1, len(shape))}
    return b"GP\0\x01" + struct.pack("<i", srs) + struct.pack("<BI", 1, WKB[geometry]) + counts[geometry] + vertices


class Symbol(NamedTuple):
    """Kind and class of a symbol of QGIS, its options, and the field that labels it."""

    kind: str
    of: str
    options: dict[str, str]
    label: str = ""


SYMBOLS = {
    "footprints": Symbol("fill", "SimpleFill", {
        "color": "90,140,200,25", "outline_color": "60,100,160,160", "outline_width": "0.2", "style": "solid",
    }),
    "strips": Symbol("line", "SimpleLine", {"line_color": "60,100,160,255", "line_width": "0.4"}, "strip"),
    "ellipses": Symbol("fill", "SimpleFill", {
        "style": "no", "outline_color": "200,60,40,255", "outline_width": "0.2",
    }),
    "points": Symbol("marker", "SimpleMarker", {
        "name": "circle", "color": "120,120,120,255", "size": "0.8", "outline_style": "no",
    }),
    "images": Symbol("marker", "SimpleMarker", {
        "name": "cross", "outline_color": "60,100,160,255", "size": "2",
    }, "image"),
    "control": Symbol("marker", "SimpleMarker", {"name": "triangle", "color": "200,60,40,255", "size": "3"}, "point"),
}  # fmt: skip


def style_of(layer: str) -> str:
    """The QML of a layer."""
    symbol = SYMBOLS[layer]
    options = [element("Option", type="QString", name=name, value=value) for name, value in symbol.options.items()]
    drawn = element(
        "layer", element("Option", *options, type="Map"), **{"class": symbol.of, "enabled": "1", "pass": "0"}
    )
    renderer = element(
        "renderer-v2",
        element("symbols", element("symbol", drawn, type=symbol.kind, name="0", alpha="1")),
        type="singleSymbol",
    )
    parts = [renderer]
    if symbol.label:
        text = element("text-style", fieldName=symbol.label, fontSize="8", textColor="40,40,40,255")
        parts.append(element("labeling", element("settings", text), type="simple"))
    root = element(
        "qgis",
        *parts,
        version="3.28.0",
        styleCategories="Symbology|Labeling",
        labelsEnabled="1" if symbol.label else "0",
    )
    return xml_of(root)


GEOPACKAGE = Format(
    "geopackage",
    "GeoPackage with styles for QGIS",
    lambda _: "",
    "layers of images, footprints, strips, points, control",
    carries=CARRIES,
    page=PAGE,
    write=write_geopackage,
    written=CARRIES,
)
