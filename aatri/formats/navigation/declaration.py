"""What photographs and lists of receivers are recognised by, and what they carry."""

import re
from functools import partial
from pathlib import Path

from aatri.formats.navigation.mrk import read_mrk
from aatri.formats.navigation.photo_folder import read_photographs
from aatri.formats.navigation.photograph import ENDINGS
from aatri.formats.navigation.xmp import PHOTOGRAPHS, read_xmp
from aatri.formats.parts.format import FileView, Format

SOME = 5
"""So many photographs of a folder are looked at."""
PAGE = "docs/formats.md#dji-mrk"
_MRK = re.compile(r"\s*[0-9]+\s+[0-9.]+\s+\[[0-9]+\]\s.*,\s*Lat\s.*,\s*Lon\s.*,\s*Ellh\s.*,\s*Q\s*$")


def _xmp(view: FileView) -> str:
    if not view.is_folder:
        is_one = view.path.suffix.lower() in PHOTOGRAPHS and "drone-dji:" in view.head and "<x:xmpmeta" in view.head
        return "an XMP packet with drone-dji" if is_one else ""
    names = [name for name in view.names if name.lower().endswith(PHOTOGRAPHS)][:SOME]
    return next((f"{name}, {seen}" for name in names if (seen := _xmp(view.of(name)))), "")


def _exif(view: FileView) -> str:
    """A folder with JPEG files of a camera; TIFF files may be grids."""
    names = [name for name in view.names if view.is_folder and name.lower().endswith((".jpg", ".jpeg"))][:SOME]
    return next((f"{name}, EXIF" for name in names if "Exif\0\0" in view.of(name).head[:64]), "")


def _files(endings: tuple[str, ...], view: FileView) -> list[Path]:
    names = [name for name in view.names if name.lower().endswith(endings)]
    return [view.path / name for name in names] if view.is_folder else [view.path]


def _mrk(view: FileView) -> str:
    return "lines with Lat, Lon, Ellh, Q" if view.lines and all(map(_MRK.match, view.lines[:5])) else ""


MRK = Format(
    "dji_mrk",
    "DJI MRK",
    _mrk,
    "lines `number seconds [week] ... lat,Lat lon,Lon h,Ellh ...`",
    carries=("positions", "standard deviations", "frame"),
    page=PAGE,
    read=read_mrk,
)
PHOTOS = Format(
    "photos",
    "photographs (EXIF, XMP)",
    _exif,
    "a folder of photographs, JPEG with EXIF",
    carries=("cameras", "distortion", "positions", "attitudes", "times", "frame", "standard deviations"),
    page="docs/methods/tie_points.md#photographs",
    read=lambda path, _, reporter: read_photographs(path, reporter=reporter),
    stage="block/photos",
    files_of=partial(_files, ENDINGS),
)
XMP = Format(
    "dji_xmp",
    "DJI photographs (XMP)",
    _xmp,
    "photographs or .xmp files with a packet `x:xmpmeta` of `drone-dji`",
    carries=("positions", "start orientations", "standard deviations", "frame"),
    page="docs/formats.md#dji-xmp",
    read=read_xmp,
    files_of=partial(_files, PHOTOGRAPHS),
)
