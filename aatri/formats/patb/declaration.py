"""What PATB's orientations are recognised by, and what they carry."""

import re

from aatri.formats.parts.format import FileView, Format
from aatri.formats.patb.reader import read_patb
from aatri.formats.patb.writer import write_patb

_NUMBER = r"\s*[-+]?[0-9]+\.[0-9]*"
_RECORDS = (
    re.compile(rf"\s*\S{{1,16}}(?:{_NUMBER}){{3}}\s*"),
    re.compile(rf"(?:{_NUMBER}){{5}}\s*"),
    re.compile(rf"(?:{_NUMBER}){{4}}\s*"),
)


def _recognised(view: FileView) -> str:
    records = view.lines[:3]
    alike = len(records) == 3 and all(form.fullmatch(line) for form, line in zip(_RECORDS, records))
    return "records `photo X Y Z` and nine numbers in two lines" if alike else ""


PATB = Format(
    "patb",
    "PATB orientations (.ori)",
    _recognised,
    "three records of fixed width a photo",
    carries=("start orientations",),
    page="docs/formats.md#patb",
    read=read_patb,
    write=write_patb,
    written=("start orientations",),
)
