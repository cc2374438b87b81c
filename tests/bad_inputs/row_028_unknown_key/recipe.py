"""Row 28: A key that is not known."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("block.yaml", "principal_distance: 24", "focal_length: 24"))
    return None
