"""DJI's `*_Timestamp.MRK`: time and position of every exposure of an RTK flight, tab separated.

    number  seconds  [week]  n,N  e,E  v,V  lat,Lat  lon,Lon  h,Ellh  sN, sE, sU  q,Q

Latitude, longitude and ellipsoidal height are those of the camera: the offset n, e, v (mm) from antenna to camera has
been taken off by the drone, and is not applied again. The standard deviations stand in the order north, east, up. Q is
50 with a fixed solution, 34 a float one, 16 single, 0 none: exposures without a fixed solution are told.

An exposure is of the image beside the file whose name ends with `_` and its number, not of that of its line.

Source: DJI, Matrice 4 series user manual; lines of a flight with a Zenmuse P1, whose XMP agrees to the millimetre.
"""

import re
from pathlib import Path

import numpy as np

from aatri.codes import OBSERVED_VALUE
from aatri.formats.parts.block_parts import BlockParts
from aatri.formats.parts.format import AS_IT_SAYS, FileView, Format, Reading
from aatri.formats.text.text_line import TextLine, check_positive, places, word_lines
from aatri.frames.conversion import Frame
from aatri.ids import several, shown
from aatri.progress import SILENT, Reporter

GEOGRAPHIC = "EPSG:4979"
"""WGS 84 with ellipsoidal heights, unless `crs` says another datum."""

KEYS = ("N", "E", "V", "Lat", "Lon", "Ellh", "Q")
FIXED = 50
"""Q of a fixed solution, and the RtkFlag of photographs."""


def read_mrk(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read positions.

    Raises
    ------
    InputError
        If a line is not of this form, or a number stands twice.
    """
    first: dict[str, TextLine] = {}
    lines = word_lines(path, reporter, blanks="\t,[]")
    place, sigma, not_fixed = [], [], []
    for line in lines:
        line.of_width(20, "an exposure `number seconds [week] n,N e,E v,V lat,Lat lon,Lon h,Ellh s, s, s q,Q`")
        labels = (*line.words[4:15:2], line.words[19])
        if labels != KEYS:
            raise line.error(f"labels {' '.join(labels)}", f"they are {' '.join(KEYS)}: the file is no MRK file")
        number = str(line.count(0))
        line.once(number, first, "exposure")
        latitude, longitude, height = (line.number(k) for k in (9, 11, 13))
        if abs(latitude) > 90 or abs(longitude) > 180:
            raise line.error(f"latitude {latitude:g}, longitude {longitude:g}", "they are degrees")
        north, east, up = line.numbers(15, 18)
        check_positive(line, (north, east, up))
        place.append((longitude, latitude, height))
        sigma.append((east, north, up))
        if line.number(18) < FIXED:
            not_fixed.append(number)
    names, notes = _names(path, list(first))
    if not_fixed:
        notes.append(f"{several(len(not_fixed), 'exposure')} without a fixed solution: {shown(not_fixed, 5)}")
    return BlockParts(
        "dji_mrk",
        [path],
        name=path.stem,
        frame=Frame("mrk", ("longitude", "latitude", "height"), reading.crs or GEOGRAPHIC),
        notes=notes,
        exterior={
            "image": names,
            "position_m": place,
            "sigma_m": sigma,
            "position_use": OBSERVED_VALUE,
            "ground_from_image": np.full((len(names), 3, 3), np.nan),
            **places(lines, [path]),
        },
    )


def _names(path: Path, numbers: list[str]) -> tuple[list[str], list[str]]:
    """Images beside the file by the number at the end of their names; the number itself where there is none or two."""
    beside: dict[str, list[str]] = {}
    for file in sorted(path.parent.iterdir()):
        ending = re.search(r"_0*([0-9]+)(_[A-Z])?$", file.stem)
        if ending and file.suffix.lower() in (".jpg", ".jpeg", ".dng", ".tif", ".tiff"):
            beside.setdefault(ending.group(1), []).append(file.name)
    without = [number for number in numbers if len(beside.get(number, ())) != 1]
    names = [number if number in without else beside[number][0] for number in numbers]
    if not without:
        return names, []
    return names, [
        f"{several(len(without), 'exposure', 'is', 'are')} called by number: no one image beside "
        f"{path.name} ends with it"
    ]


_MRK = re.compile(r"\s*[0-9]+\s+[0-9.]+\s+\[[0-9]+\]\s.*,\s*Lat\s.*,\s*Lon\s.*,\s*Ellh\s.*,\s*Q\s*$")


def _mrk(view: FileView) -> str:
    return "lines with Lat, Lon, Ellh, Q" if view.lines and all(map(_MRK.match, view.lines[:5])) else ""


MRK = Format(
    "dji_mrk",
    "DJI MRK",
    _mrk,
    "lines `number seconds [week] ... lat,Lat lon,Lon h,Ellh ...`",
    carries=("positions", "standard deviations", "frame"),
    page="docs/formats.md#dji-mrk",
    read=read_mrk,
)
