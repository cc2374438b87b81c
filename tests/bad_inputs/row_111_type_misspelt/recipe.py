"""Row 111: A kind of observation that is not known."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("geodetic.csv", "angle,", "angel,"))
    return None
