"""What PATB's orientations are recognised by, and what they carry."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from aatri.formats.parts.format import FileView, Format, Reading, Writing
from aatri.progress import Reporter

if TYPE_CHECKING:
    from aatri.formats.parts.block_parts import BlockParts
    from aatri.formats.results.oriented_block import OrientedBlock


_NUMBER = r"\s*[-+]?[0-9]+\.[0-9]*"
_RECORDS = (re.compile(rf"\s*\S+(?:{_NUMBER}){{3}}\s*"), re.compile(rf"(?:{_NUMBER}){{5}}\s*"),
            re.compile(rf"(?:{_NUMBER}){{4}}\s*"))  # fmt: skip


def _read(path: Path, reading: Reading, reporter: Reporter) -> BlockParts:
    from aatri.formats.patb.reader import read_patb

    return read_patb(path, reading, reporter)


def _recognised(view: FileView) -> str:
    records = view.lines[:3]
    alike = len(records) == 3 and all(form.fullmatch(line) for form, line in zip(_RECORDS, records))
    return "records `photo X Y Z` and nine numbers in two lines" if alike else ""


def _write(oriented: OrientedBlock, folder: Path, writing: Writing, reporter: Reporter) -> None:
    from aatri.formats.patb.writer import write_patb

    write_patb(oriented, folder, writing, reporter)


PATB = Format(
    "patb", "PATB orientations (.ori)", _recognised, "three records of fixed width a photo",
    carries=("start orientations",), drops=("cameras", "image points", "control", "frame", "standard deviations"),
    page="docs/formats.md#patb", read=_read, write=_write, written=("start orientations",),
)  # fmt: skip
