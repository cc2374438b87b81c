"""Row 41: A format of one number."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("block.yaml", "format: [6000, 4000]", "format: [6000]"))
    return None
