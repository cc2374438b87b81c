"""Row 115: Three check points."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import film

SHOWN = "accuracy"


def make(folder: Path) -> list[str] | None:
    film(folder, until="accuracy")
    return None
