"""Row 110: A distance from a point to itself: set aside, named."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block


def make(folder: Path) -> list[str] | None:
    block(folder)
    return None
