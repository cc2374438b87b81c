"""Row 82: A negative standard deviation."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("ground_points.csv", "7.378,1", "7.378,-1"), replaced("image_points.csv", "4,4", "-4,4"))
    return None
