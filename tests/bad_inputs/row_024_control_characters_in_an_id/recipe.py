"""Row 24: An id that would drive the terminal."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("images.csv", "a2,007", "a\x1b[31m,007"))
    return None
