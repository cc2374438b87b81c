"""Row 44: Images, and no camera at all."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import FILES, block


def make(folder: Path) -> list[str] | None:
    text = FILES["block.yaml"]
    block(folder, {"block.yaml": text[: text.index("cameras:")]})
    return None
