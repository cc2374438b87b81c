"""Row 39: A negative principal distance."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("block.yaml", "24.01", "-24.01"))
    return None
