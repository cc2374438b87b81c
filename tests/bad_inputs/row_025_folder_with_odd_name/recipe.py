"""Row 25: A folder with blanks, accents and Chinese in its name."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block


def make(folder: Path) -> list[str] | None:
    place = folder / "测试 空格é"
    place.mkdir()
    block(place)
    return ["run", "-q", str(place / "pipeline.yaml")]
