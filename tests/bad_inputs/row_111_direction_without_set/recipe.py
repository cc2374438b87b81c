"""Row 111: A direction without its set."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("geodetic.csv", ",s1,", ",,"))
    return None
