"""Row 111: An angle without its vertex."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("geodetic.csv", "0.0003,K,", "0.0003,,"))
    return None
