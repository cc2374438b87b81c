"""What is written for geographic information systems."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from aatri.formats.parts.format import Content, Format, Writing
from aatri.progress import Reporter

if TYPE_CHECKING:
    from aatri.formats.results.oriented_block import OrientedBlock

PAGE = "docs/formats.md#geopackage-and-geojson"
CARRIES: tuple[Content, ...] = ("control", "check points", "start values of points", "start orientations", "strips",
                                "frame", "standard deviations")  # fmt: skip


def _write_geopackage(oriented: OrientedBlock, folder: Path, writing: Writing, reporter: Reporter) -> None:
    from aatri.formats.gis.geopackage import write_geopackage

    write_geopackage(oriented, folder, writing, reporter)


def _write_geojson(oriented: OrientedBlock, folder: Path, writing: Writing, reporter: Reporter) -> None:
    from aatri.formats.gis.geojson import write_geojson

    write_geojson(oriented, folder, writing, reporter)


GEOPACKAGE = Format(
    "geopackage", "GeoPackage with styles for QGIS", lambda _: "",
    "layers of images, footprints, strips, points, control",
    carries=CARRIES, drops=("cameras", "image points"), page=PAGE, write=_write_geopackage, written=CARRIES,
)  # fmt: skip
GEOJSON = Format(
    "geojson", "GeoJSON", lambda _: "",
    "layers of images, footprints, strips, points, control, in longitude and latitude",
    carries=CARRIES, drops=("cameras", "image points"), page=PAGE, write=_write_geojson, written=CARRIES,
)  # fmt: skip
