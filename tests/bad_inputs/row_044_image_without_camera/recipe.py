"""Row 44: An image of a camera that is not there."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("images.csv", "d2,uav", "d2,uva"))
    return None
