"""Row 77: Control in feet, in a local system."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import digital, every, scaled


def make(folder: Path) -> list[str] | None:
    digital(folder, scaled("ground_points.csv", every, X=1 / 0.3048, Y=1 / 0.3048, Z=1 / 0.3048), until="absolute")
    return None
