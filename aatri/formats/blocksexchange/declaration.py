"""What BlocksExchange XML is recognised by, and what it carries."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from aatri.formats.parts.format import FileView, Format, Reading
from aatri.progress import Reporter

if TYPE_CHECKING:
    from aatri.formats.parts.block_parts import BlockParts


def _read(path: Path, reading: Reading, reporter: Reporter) -> BlockParts:
    from aatri.formats.blocksexchange.reader import read_blocksexchange

    return read_blocksexchange(path, reporter, allowed_px=reading.lens_misfit_px)


def _recognised(view: FileView) -> str:
    return "XML with BlocksExchange" if "<BlocksExchange" in view.head else ""


BLOCKSEXCHANGE = Format(
    "blocksexchange", "BlocksExchange XML", _recognised, "XML with `BlocksExchange`",
    carries=("cameras", "distortion", "image points", "control", "check points", "start values of points",
             "start orientations", "frame", "standard deviations"),
    drops=("covariances", "strips", "times", "rigs", "film"),
    page="docs/formats.md#blocksexchange", read=_read,
)  # fmt: skip
