"""Row 17: Two images of one id."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import added, block


def make(folder: Path) -> list[str] | None:
    block(folder, added("images.csv", "a1,uav,,,,,\n"))
    return None
