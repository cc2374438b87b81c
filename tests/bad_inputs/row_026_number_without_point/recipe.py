"""Row 26: 1e-6 is a number."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("block.yaml", "k1: 1e-7", "k1: 1e-6"))
    return None
