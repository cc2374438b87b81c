"""Row 79: Flying heights above ground as heights of the cameras: control lies above them."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import digital, every, moved


def make(folder: Path) -> list[str] | None:
    digital(folder, moved("exterior.csv", every, Z=-120.0), until="absolute")
    return None
