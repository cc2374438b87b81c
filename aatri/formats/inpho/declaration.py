"""What a project of Inpho is recognised by, and what is read of it."""

import re

from aatri.formats.inpho.reader import read_inpho
from aatri.formats.parts.format import FileView, Format

_BLOCK = re.compile(r"^\$(PROJECT\s+[0-9]|PHOTO\s*$|CAMERA(_DEFINITION)?\s*$)", re.MULTILINE)


def _recognised(view: FileView) -> str:
    seen = _BLOCK.search(view.head)
    return f"a block {seen.group().strip()}" if seen else ""


INPHO = Format(
    "inpho",
    "Inpho project (.prj)",
    _recognised,
    "blocks `$PROJECT`, `$CAMERA_DEFINITION`, `$PHOTO` ... `$END`",
    carries=("cameras", "image points", "start orientations"),
    page="docs/formats.md#inpho",
    read=read_inpho,
)
