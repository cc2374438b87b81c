"""What BlocksExchange XML is recognised by, and what it carries."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from aatri.formats.parts.format import FileView, Format, Reading, Writing
from aatri.progress import Reporter

if TYPE_CHECKING:
    from aatri.formats.parts.block_parts import BlockParts
    from aatri.formats.results.oriented_block import OrientedBlock


def _read(path: Path, reading: Reading, reporter: Reporter) -> BlockParts:
    from aatri.formats.blocksexchange.reader import read_blocksexchange

    return read_blocksexchange(path, reporter, allowed_px=reading.lens_misfit_px)


def _recognised(view: FileView) -> str:
    return "XML with BlocksExchange" if "<BlocksExchange" in view.head else ""


def _write(oriented: OrientedBlock, folder: Path, writing: Writing, reporter: Reporter) -> None:
    from aatri.formats.blocksexchange.writer import write_blocksexchange

    write_blocksexchange(oriented, folder, writing, reporter)


BLOCKSEXCHANGE = Format(
    "blocksexchange", "BlocksExchange XML", _recognised, "XML with `BlocksExchange`",
    carries=("cameras", "distortion", "image points", "control", "check points", "start values of points",
             "start orientations", "frame", "standard deviations"),
    drops=("covariances", "strips", "times", "rigs", "film"),
    page="docs/formats.md#blocksexchange", read=_read, write=_write,
    written=("cameras", "distortion", "image points", "control", "check points", "start values of points",
             "start orientations", "frame", "standard deviations"),
)  # fmt: skip
