"""Row 19: Two ids at one place: a warning."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import added, block


def make(folder: Path) -> list[str] | None:
    block(folder, added("ground_points.csv", "K2,4505079.577,446263.976,6.378,1,1,1,,,\n"))
    return None
