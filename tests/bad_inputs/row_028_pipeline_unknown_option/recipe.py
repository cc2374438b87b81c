"""Row 28: An option that is not known."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, pipeline


def make(folder: Path) -> list[str] | None:
    block(folder)
    pipeline(folder, "  block: {use: block/tables, with: {path: block, pth: 1}}\n")
    return None
