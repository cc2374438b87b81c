"""Row 82: No standard deviation, and no default."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("block.yaml", "image: 5, fiducial: 2, ", ""))
    return None
