"""Row 87: A covariance that no observation can have."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("ground_points.csv", "1,2,3,0.5", "1,2,3,2.5"))
    return None
