"""Row 28: A tag that would call a function."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, pipeline


def make(folder: Path) -> list[str] | None:
    block(folder)
    pipeline(folder, "  block: !!python/object/apply:os.system [touch executed]\n")
    return None
