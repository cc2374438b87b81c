"""Row 117: Points of two rays, whose image points nothing controls along the base."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import film

SHOWN = "bundle"


def make(folder: Path) -> list[str] | None:
    film(folder)
    return None
