"""Row 14: A workbook that is called CSV."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block


def make(folder: Path) -> list[str] | None:
    block(folder, {"images.csv": b"PK\x03\x04\x14\0"})
    return None
