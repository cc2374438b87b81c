"""Row 110: A distance of 0: set aside, named."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("geodetic.csv", "141.42", "0"))
    return None
