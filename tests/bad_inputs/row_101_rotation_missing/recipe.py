"""Row 101: Angles, and no rotation system."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("block.yaml", "rotation: phi-omega-kappa\n", ""))
    return None
