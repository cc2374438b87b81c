"""Row 28: Brackets without end."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block


def make(folder: Path) -> list[str] | None:
    block(folder, {"block.yaml": "a: " + "[" * 20000})
    return None
