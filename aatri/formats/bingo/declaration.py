"""What BINGO's files are recognised by, and what they carry."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from aatri.formats.parts.format import FileView, Format, Reading, Writing
from aatri.progress import Reporter

if TYPE_CHECKING:
    from aatri.formats.parts.block_parts import BlockParts
    from aatri.formats.results.oriented_block import OrientedBlock

PAGE = "docs/formats.md#bingo"
_NUMBER = r"[-+]?[0-9]+(?:\.[0-9]*)?"
_HEAD, _POINT = re.compile(r"\s*\S+(?:\s+\S+)?\s*"), re.compile(rf"\s*\S+\s+{_NUMBER}\s+{_NUMBER}\s*")


def _read_image_coordinates(path: Path, reading: Reading, reporter: Reporter) -> BlockParts:  # noqa: ARG001
    from aatri.formats.bingo.reader import read_image_coordinates

    return read_image_coordinates(path, reporter)


def _read_geoin(path: Path, reading: Reading, reporter: Reporter) -> BlockParts:  # noqa: ARG001
    from aatri.formats.bingo.reader import read_geoin

    return read_geoin(path, reporter)


def _write(oriented: OrientedBlock, folder: Path, writing: Writing, reporter: Reporter) -> None:
    from aatri.formats.bingo.writer import write_bingo

    write_bingo(oriented, folder, writing, reporter)


def _image_coordinates(view: FileView) -> str:
    lines = [line for line in view.lines if not line.startswith("*")]
    ended = any(line.strip() == "-99" for line in lines)
    begun = len(lines) > 2 and _HEAD.fullmatch(lines[0]) and _POINT.fullmatch(lines[1])
    return "images with lines `point x y`, ended by -99" if ended and begun else ""


def _geoin(view: FileView) -> str:
    keys = {line[:4] for line in view.lines}
    seen = [key for key in ("CAPA", "RADI", "CONT") if key in keys]
    return f"lines {', '.join(seen)}" if seen else ""


BINGO = Format(
    "bingo", "BINGO image coordinates", _image_coordinates, "images with lines `point x y`, ended by -99",
    carries=("image points",), drops=("cameras", "control", "standard deviations", "start orientations"),
    page=PAGE, read=_read_image_coordinates, write=_write,
    written=("cameras", "image points", "control"),
)  # fmt: skip
GEOIN = Format(
    "bingo_geoin", "BINGO geoin.dat", _geoin, "lines that begin with CAPA, RADI, CONT",
    carries=("cameras", "distortion", "control", "standard deviations"),
    drops=("image points", "check points", "frame", "start orientations"), page=PAGE, read=_read_geoin,
)  # fmt: skip
