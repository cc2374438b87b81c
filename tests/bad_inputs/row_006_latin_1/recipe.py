"""Row 6: An 8-bit encoding that nobody can know."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import FILES, block


def make(folder: Path) -> list[str] | None:
    block(folder, {"images.csv": FILES["images.csv"].replace("cloud", "Gewölk").encode("latin-1")})
    return None
