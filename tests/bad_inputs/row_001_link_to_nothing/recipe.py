"""Row 1: A table that is a link to nothing."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block


def make(folder: Path) -> list[str] | None:
    block(folder, {"geodetic.csv": None})
    (folder / "block" / "geodetic.csv").symlink_to("gone.csv")
    return None
