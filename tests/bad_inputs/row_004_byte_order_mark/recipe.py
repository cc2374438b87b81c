"""Row 4: UTF-8 with its mark: read."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import FILES, block


def make(folder: Path) -> list[str] | None:
    block(folder, {"images.csv": "\ufeff" + FILES["images.csv"]})
    return None
