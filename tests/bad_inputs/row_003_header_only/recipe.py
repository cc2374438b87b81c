"""Row 3: A mandatory table without rows."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block


def make(folder: Path) -> list[str] | None:
    block(folder, {"images.csv": "image,camera\n"})
    return None
