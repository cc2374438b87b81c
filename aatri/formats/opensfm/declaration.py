"""What the files of OpenSfM and OpenDroneMap are recognised by, and what they carry."""

import re

from aatri.formats.opensfm.lists import read_gcp_list, read_geo, read_ground_control
from aatri.formats.opensfm.reconstruction import read_reconstruction, read_tracks
from aatri.formats.opensfm.writer import write_opensfm
from aatri.formats.parts.format import FileView, Format

PAGE = "docs/formats.md#opensfm-and-opendronemap"
_NUMBER = r"[-+]?[0-9.,]+(?:[eE][-+]?[0-9]+)?"
_CRS = re.compile(
    r"\s*(EPSG:[0-9]+(?:\+[0-9]+)?|\+proj=.*|\+init=.*|WGS84(?:\s+UTM\s+[0-9]+\s*[NS])?)\s*$", re.IGNORECASE
)
_GCP_ROW = re.compile(rf"\s*{_NUMBER}\s+{_NUMBER}\s+(?:{_NUMBER}|nan)\s+{_NUMBER}\s+{_NUMBER}\s+\S+", re.IGNORECASE)
_GEO_ROW = re.compile(rf"\s*\S*[A-Za-z_.]\S*\s+{_NUMBER}\s+{_NUMBER}(?:\s|$)")


def _reconstruction(view: FileView) -> bool:
    head = view.head.lstrip()
    return head.startswith("[") and '"cameras"' in head and ('"projection_type"' in head or '"shots"' in head)


def _tracks(view: FileView) -> str:
    lines = view.lines[:2]
    if lines and lines[0].startswith("OPENSFM_TRACKS_VERSION"):
        return lines[0].strip()
    return ""


def _ground_control(view: FileView) -> bool:
    keys = ('"points"', '"observations"', '"shot_id"')
    return view.head.lstrip().startswith("{") and all(key in view.head for key in keys)


def _system_and_rows(view: FileView) -> tuple[str, list[str]]:
    """The first line that is no remark, and the five below it."""
    lines = [line for line in view.lines if not line.lstrip().startswith("#")]
    return (lines[0], lines[1:6]) if lines else ("", [])


def _gcp_list(view: FileView) -> bool:
    system, rows = _system_and_rows(view)
    numbers = bool(rows) and all(map(_GCP_ROW.match, rows))
    return numbers and system.count(" ") < 12 and not re.match(rf"\s*{_NUMBER}\s", system)


def _geo(view: FileView) -> bool:
    system, rows = _system_and_rows(view)
    return bool(rows and _CRS.match(system)) and all(map(_GEO_ROW.match, rows))


RECONSTRUCTION = Format(
    "opensfm", "OpenSfM reconstruction", _reconstruction, "a JSON list with `cameras` and `shots`",
    carries=("cameras", "distortion", "start orientations", "start values of points", "times", "frame"),
    page=PAGE, read=read_reconstruction, write=write_opensfm,
    written=("cameras", "distortion", "image points", "control", "start orientations", "start values of points",
             "times", "frame"),
    estimates_cameras=True,
)  # fmt: skip
TRACKS = Format(
    "opensfm_tracks",
    "OpenSfM tracks.csv",
    _tracks,
    "a first line OPENSFM_TRACKS_VERSION",
    carries=("image points",),
    page=PAGE,
    read=read_tracks,
)
GROUND_CONTROL = Format(
    "opensfm_gcp",
    "OpenSfM ground_control_points.json",
    _ground_control,
    "JSON `points` with `observations`",
    carries=("control", "image points", "frame"),
    page=PAGE,
    read=read_ground_control,
)
GCP_LIST = Format(
    "odm_gcp",
    "OpenDroneMap gcp_list.txt",
    _gcp_list,
    "a coordinate system, then rows `x y z column row image`",
    carries=("control", "image points", "frame"),
    page=PAGE,
    read=read_gcp_list,
)
GEO = Format(
    "odm_geo",
    "OpenDroneMap geo.txt",
    _geo,
    "a coordinate system, then rows `image x y ...`",
    carries=("positions", "attitudes", "standard deviations", "frame"),
    page=PAGE,
    read=read_geo,
)
