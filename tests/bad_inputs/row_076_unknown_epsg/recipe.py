"""Row 76: A coordinate system that does not exist."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import film, said


def make(folder: Path) -> list[str] | None:
    film(folder, said('"crs": "local"', '"crs": "EPSG:99999"'), until="block")
    return None
