"""What PATB's orientations are recognised by, and what they carry."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from aatri.formats.parts.format import Format, Writing
from aatri.progress import Reporter

if TYPE_CHECKING:
    from aatri.formats.results.oriented_block import OrientedBlock


def _write(oriented: OrientedBlock, folder: Path, writing: Writing, reporter: Reporter) -> None:
    from aatri.formats.patb.writer import write_patb

    write_patb(oriented, folder, writing, reporter)


PATB = Format(
    "patb", "PATB orientations (.ori)", lambda _: "", "three records of fixed width a photo",
    carries=("start orientations",), drops=("cameras", "image points", "control", "frame", "standard deviations"),
    page="docs/formats.md#patb", write=_write, written=("start orientations",),
)  # fmt: skip
