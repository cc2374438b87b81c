"""Row 11: nan, inf, too large, an error of a spreadsheet."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import FILES, block


def make(folder: Path) -> list[str] | None:
    block(
        folder,
        {
            "image_points.csv": FILES["image_points.csv"]
            .replace("10.5", "nan", 1)
            .replace("-30.1", "-inf", 1)
            .replace(",50,", ",1e400,", 1)
            .replace(",55,", ",#N/A,", 1)
        },
    )
    return None
