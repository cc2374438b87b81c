"""Row 42: The last strip taken with another lens, under the same camera."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import Row, digital, each


def zoomed(row: Row) -> Row:
    if not row["image"].startswith("03"):
        return row
    return row | {
        "x": f"{2736 + 0.8 * (float(row['x']) - 2736):.2f}",
        "y": f"{1824 + 0.8 * (float(row['y']) - 1824):.2f}",
    }


def make(folder: Path) -> list[str] | None:
    digital(folder, each("image_points.csv", zoomed), until="absolute")
    return None
