"""What lists of receivers are recognised by, and what they carry."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from aatri.formats.parts.format import FileView, Format, Reading
from aatri.progress import Reporter

if TYPE_CHECKING:
    from aatri.formats.parts.block_parts import BlockParts

PAGE = "docs/formats.md#dji-mrk"
_MRK = re.compile(r"\s*[0-9]+\s+[0-9.]+\s+\[[0-9]+\]\s.*,\s*Lat\s.*,\s*Lon\s.*,\s*Ellh\s.*,\s*Q\s*$")


def _read_mrk(path: Path, reading: Reading, reporter: Reporter) -> BlockParts:
    from aatri.formats.navigation.mrk import read_mrk

    return read_mrk(path, reading.crs, reporter)


def _mrk(view: FileView) -> str:
    return "lines with Lat, Lon, Ellh, Q" if view.lines and all(map(_MRK.match, view.lines[:5])) else ""


MRK = Format(
    "dji_mrk", "DJI MRK", _mrk, "lines `number seconds [week] ... lat,Lat lon,Lon h,Ellh ...`",
    carries=("positions", "standard deviations", "frame"),
    drops=("attitudes", "image points", "control", "cameras"), page=PAGE, read=_read_mrk,
)  # fmt: skip
