"""Row 95: A lens parameter that nothing determines: the distortion of film whose points lie on one circle."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import film


def make(folder: Path) -> list[str] | None:
    film(folder)
    return None
