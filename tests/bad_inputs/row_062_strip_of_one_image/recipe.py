"""Row 62: A strip of one image."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import each, film


def make(folder: Path) -> list[str] | None:
    film(folder, each("images.csv", lambda row: row | {"strip": "3"} if row["image"] == "0204" else row))
    return None
