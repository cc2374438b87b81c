"""Row 5: Unicode text of a spreadsheet: read as such, with a warning."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import FILES, block


def make(folder: Path) -> list[str] | None:
    block(folder, {"images.csv": FILES["images.csv"].encode("utf-16")})
    return None
