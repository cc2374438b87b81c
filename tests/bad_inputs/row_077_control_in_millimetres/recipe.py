"""Row 77: Control in millimetres, in a local system."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import digital, every, scaled


def make(folder: Path) -> list[str] | None:
    digital(folder, scaled("ground_points.csv", every, X=1000, Y=1000, Z=1000), until="absolute")
    return None
