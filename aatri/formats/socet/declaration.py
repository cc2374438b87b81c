"""What SOCET's point files are recognised by, and what they carry."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from aatri.formats.parts.format import FileView, Format, Reading
from aatri.progress import Reporter

if TYPE_CHECKING:
    from aatri.formats.parts.block_parts import BlockParts

PAGE = "docs/formats.md#socet"


def _read_gpf(path: Path, reading: Reading, reporter: Reporter) -> BlockParts:
    from aatri.formats.socet.reader import read_gpf

    return read_gpf(path, reading.crs, reporter)


def _read_ipf(path: Path, reading: Reading, reporter: Reporter) -> BlockParts:  # noqa: ARG001
    from aatri.formats.socet.reader import read_ipf

    return read_ipf(path, reporter)


def _begins(view: FileView, words: str) -> str:
    return f"a first line {words}" if view.head.startswith(words) else ""


GPF = Format(
    "socet_gpf", "SOCET ground points (.gpf)", lambda view: _begins(view, "GROUND POINT FILE"),
    "a first line GROUND POINT FILE", carries=("control", "start values of points", "standard deviations", "frame"),
    drops=("image points", "check points", "covariances"), page=PAGE, read=_read_gpf,
)  # fmt: skip
IPF = Format(
    "socet_ipf", "SOCET image points (.ipf)", lambda view: _begins(view, "IMAGE POINT FILE"),
    "a first line IMAGE POINT FILE", carries=("image points", "standard deviations"),
    drops=("cameras", "control", "start orientations"), page=PAGE, read=_read_ipf,
)  # fmt: skip
