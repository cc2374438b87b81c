"""Row 77: Only the heights of the control in feet."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import digital, every, scaled


def make(folder: Path) -> list[str] | None:
    digital(folder, scaled("ground_points.csv", every, Z=1 / 0.3048), until="absolute")
    return None
