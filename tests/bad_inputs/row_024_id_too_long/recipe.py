"""Row 24: An id of 300 characters."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import added, block


def make(folder: Path) -> list[str] | None:
    block(folder, added("images.csv", "b" * 300 + ",uav,,,,,\n"))
    return None
