"""Row 14: A zero byte within a text."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block


def make(folder: Path) -> list[str] | None:
    block(folder, {"images.csv": b"image,camera\na\x001,007\n"})
    return None
