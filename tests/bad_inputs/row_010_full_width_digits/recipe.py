"""Row 10: Full-width digits, another minus sign."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import FILES, block


def make(folder: Path) -> list[str] | None:
    block(
        folder,
        {"image_points.csv": FILES["image_points.csv"].replace("10.5", "１２", 1).replace("-30.1", "\u221230.1", 1)},
    )
    return None
