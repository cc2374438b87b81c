"""Row 28: A key of a stage that is not known."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, pipeline


def make(folder: Path) -> list[str] | None:
    block(folder)
    pipeline(folder, "  block: {use: block/tables, wiht: {path: block}}\n")
    return None
