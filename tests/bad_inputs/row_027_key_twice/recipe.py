"""Row 27: A key that stands twice."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("block.yaml", "terrain_height: 6.1", "rotation: phi-omega-kappa"))
    return None
