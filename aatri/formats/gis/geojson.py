"""Writing of layers as GeoJSON, a file a layer: longitude, latitude and ellipsoidal height of WGS 84.

Source: RFC 7946, The GeoJSON Format.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from aatri.arrays import Float
from aatri.errors import InputError
from aatri.formats.gis.layers import CARRIES, PAGE, layers_of
from aatri.formats.parts.block_parts import LOCAL
from aatri.formats.parts.format import AS_USUAL, Format, Writing
from aatri.formats.parts.of_block import frame_of
from aatri.formats.parts.one_frame import geographic
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.formats.text.written_files import write_files
from aatri.frames.conversion import WGS84, Frame, convert, crs_of
from aatri.frames.heights import is_tangent_frame
from aatri.progress import SILENT, Reporter

DIGITS = 10
"""Decimals of degrees: 0.01 mm."""


def write_geojson(
    oriented: OrientedBlock, folder: Path, writing: Writing = AS_USUAL, reporter: Reporter = SILENT
) -> None:
    """Write a file a layer: `points.geojson` ...

    Raises
    ------
    InputError
        If the block is local: it has no longitude and latitude.
    """
    frame = frame_of(oriented.block)
    if frame == LOCAL:
        what = "GeoJSON is in longitude and latitude, and the block declares no coordinate system"
        raise InputError(what, where=f"block {oriented.block.name}", remedy="export as geopackage, or give its crs")
    files = {}
    for layer in layers_of(oriented):
        ends = np.cumsum([len(shape) for shape in layer.shapes])
        degrees = np.split(_degrees(np.concatenate(layer.shapes), frame), ends[:-1])
        features = [
            {
                "type": "Feature",
                "geometry": {"type": layer.geometry, "coordinates": _coordinates(layer.geometry, shape)},
                "properties": dict(zip(layer.fields, row)),
            }
            for shape, row in zip(degrees, layer.rows)
        ]
        document = {"type": "FeatureCollection", "name": layer.name, "features": features}
        files[f"{layer.name}.geojson"] = json.dumps(document, ensure_ascii=False) + "\n"
    write_files(folder, files)


def _degrees(xyz_m: Float, frame: Frame) -> Float:
    if is_tangent_frame(frame.crs) or crs_of(frame).is_geocentric:
        return geographic(xyz_m, frame)
    return convert(xyz_m, np.zeros((len(xyz_m), 3, 3)), frame, WGS84)[0]


def _coordinates(geometry: str, shape: Float) -> Any:
    """Vertices; an outline runs counterclockwise, as the standard wants it."""
    x, y = shape[:, 0] - shape[0, 0], shape[:, 1] - shape[0, 1]
    clockwise = geometry == "Polygon" and float(x[:-1] @ y[1:] - x[1:] @ y[:-1]) < 0
    vertices = [[round(lon, DIGITS), round(lat, DIGITS), round(h, 4)] for lon, lat, h in shape.tolist()]
    if geometry == "Point":
        return vertices[0]
    return [vertices[::-1] if clockwise else vertices] if geometry == "Polygon" else vertices


GEOJSON = Format(
    "geojson",
    "GeoJSON",
    lambda _: "",
    "layers of images, footprints, strips, points, control, in longitude and latitude",
    carries=CARRIES,
    page=PAGE,
    write=write_geojson,
    written=CARRIES,
)
