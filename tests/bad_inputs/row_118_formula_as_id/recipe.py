"""Row 118: An id that a spreadsheet would compute: read, shielded where it is exported."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import renamed


def make(folder: Path) -> list[str] | None:
    renamed(folder, {"K": "=1+1"})
    return None
