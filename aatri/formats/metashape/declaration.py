"""What documents of Metashape are recognised by, and what they carry."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from aatri.formats.parts.format import FileView, Format, Reading, Writing
from aatri.progress import Reporter

if TYPE_CHECKING:
    from aatri.formats.parts.block_parts import BlockParts
    from aatri.formats.results.oriented_block import OrientedBlock


def _read(path: Path, reading: Reading, reporter: Reporter) -> BlockParts:
    from aatri.formats.metashape.reader import read_metashape

    return read_metashape(path, reporter, allowed_px=reading.lens_misfit_px)


def _write(oriented: OrientedBlock, folder: Path, writing: Writing, reporter: Reporter) -> None:
    from aatri.formats.metashape.writer import write_metashape

    write_metashape(oriented, folder, writing, reporter)


def _recognised(view: FileView) -> str:
    if "doc.xml" in view.names and not view.is_folder:
        return "an archive with doc.xml"
    seen = re.search(r"<document\s+version=.*?<chunk", view.head, re.DOTALL)
    return "XML with <document version> and <chunk>" if seen else ""


METASHAPE = Format(
    "metashape", "Metashape, PhotoScan", _recognised, "XML with <document version> and <chunk>, or a .psz",
    carries=("cameras", "distortion", "image points", "control", "check points", "positions", "start orientations",
             "standard deviations", "frame"),
    drops=("strips", "times", "film", "rigs", "covariances", "geodetic observations"),
    page="docs/formats.md#metashape-and-photoscan", read=_read, write=_write,
    written=("cameras", "distortion", "control", "check points", "positions", "start orientations",
             "standard deviations", "frame"),
)  # fmt: skip
