"""What BINGO's files are recognised by, and what they carry."""

import re

from aatri.formats.bingo.reader import read_geoin, read_image_coordinates
from aatri.formats.bingo.writer import write_bingo
from aatri.formats.parts.format import FileView, Format

PAGE = "docs/formats.md#bingo"
_NUMBER = r"[-+]?[0-9]+(?:\.[0-9]*)?"
_HEAD, _POINT = re.compile(r"\s*\S+(?:\s+\S+)?\s*"), re.compile(rf"\s*\S+\s+{_NUMBER}\s+{_NUMBER}(?:\s+\S+)?\s*")


def _image_coordinates(view: FileView) -> bool:
    lines = [line for line in view.lines if not line.startswith(("*", "C "))]
    ended = any(line.strip() == "-99" for line in lines)
    return ended and len(lines) > 2 and bool(_HEAD.fullmatch(lines[0]) and _POINT.fullmatch(lines[1]))


def _geoin(view: FileView) -> str:
    keys = {line[:4] for line in view.lines}
    seen = [key for key in ("CAPA", "RADI", "CONT") if key in keys]
    return f"lines {', '.join(seen)}" if seen else ""


BINGO = Format(
    "bingo",
    "BINGO image coordinates",
    _image_coordinates,
    "images with lines `point x y`, ended by -99",
    carries=("image points",),
    page=PAGE,
    read=read_image_coordinates,
    write=write_bingo,
    written=("cameras", "image points", "control", "standard deviations"),
)
GEOIN = Format(
    "bingo_geoin",
    "BINGO geoin.dat",
    _geoin,
    "lines that begin with CAPA, RADI, CONT",
    carries=("cameras", "distortion", "control", "standard deviations"),
    page=PAGE,
    read=read_geoin,
)
