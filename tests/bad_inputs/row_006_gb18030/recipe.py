"""Row 6: Chinese text: read as such, with a warning."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import FILES, block


def make(folder: Path) -> list[str] | None:
    block(folder, {"images.csv": FILES["images.csv"].replace("cloud", "点号").encode("gb18030")})
    return None
