"""Row 87: A covariance with a row that is not there."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("covariances.csv", "4,5", "4,9"))
    return None
