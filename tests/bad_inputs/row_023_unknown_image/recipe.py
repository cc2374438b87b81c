"""Row 23: References to what is not there."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(
        folder,
        replaced("image_points.csv", "3,d2", "3,d3"),
        replaced("images.csv", "d2,uav", "d2,uaw"),
        replaced("geodetic.csv", "distance,1,2", "distance,1,77"),
    )
    return None
