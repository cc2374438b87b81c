"""Row 79: Depths where heights belong: control with the sign turned."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import digital, every, scaled


def make(folder: Path) -> list[str] | None:
    digital(folder, scaled("ground_points.csv", every, Z=-1.0), until="absolute")
    return None
