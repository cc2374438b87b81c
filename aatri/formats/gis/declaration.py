"""What is written for geographic information systems."""

from aatri.formats.gis.geojson import write_geojson
from aatri.formats.gis.geopackage import write_geopackage
from aatri.formats.parts.format import Content, Format

PAGE = "docs/formats.md#geopackage-and-geojson"
CARRIES: tuple[Content, ...] = (
    "control",
    "check points",
    "start values of points",
    "start orientations",
    "strips",
    "frame",
    "standard deviations",
)


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
