"""Row 44: A camera that no image has."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import digital, said

SPARE = "spare: {kind: digital, image_coordinates: photo, format: [100, 100], principal_distance: 5}"


def make(folder: Path) -> list[str] | None:
    digital(folder, said("cameras:\n", f"cameras:\n  {SPARE}\n"), until="absolute")
    return None
