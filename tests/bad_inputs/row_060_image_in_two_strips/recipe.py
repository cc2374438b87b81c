"""Row 60: An image in two strips."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import added, block


def make(folder: Path) -> list[str] | None:
    block(folder, added("images.csv", "a1,007,s2,1,10.5,day 1,\n"))
    return None
