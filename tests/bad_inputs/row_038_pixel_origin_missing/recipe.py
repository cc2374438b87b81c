"""Row 38: Pixels without origin."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("block.yaml", ", origin: top-left-corner", ""))
    return None
