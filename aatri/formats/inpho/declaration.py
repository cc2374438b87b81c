"""What a project of Inpho is recognised by, and what is read of it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from aatri.formats.parts.format import FileView, Format, Reading
from aatri.progress import Reporter

if TYPE_CHECKING:
    from aatri.formats.parts.block_parts import BlockParts

_BLOCK = re.compile(r"^\$(PROJECT\s+[0-9]|PHOTO\s*$|CAMERA(_DEFINITION)?\s*$)", re.MULTILINE)


def _read(path: Path, reading: Reading, reporter: Reporter) -> BlockParts:
    from aatri.formats.inpho.reader import read_inpho

    return read_inpho(path, reading, reporter)


def _recognised(view: FileView) -> str:
    seen = _BLOCK.search(view.head)
    return f"a block {seen.group().strip()}" if seen else ""


INPHO = Format(
    "inpho", "Inpho project (.prj)", _recognised, "blocks `$PROJECT`, `$CAMERA_DEFINITION`, `$PHOTO` ... `$END`",
    carries=("cameras", "image points", "start orientations"),
    drops=("distortion", "control", "check points", "positions", "attitudes", "frame", "strips", "film"),
    page="docs/formats.md#inpho", read=_read,
)  # fmt: skip
