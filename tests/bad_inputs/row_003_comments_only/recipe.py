"""Row 3: A table of comments only."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block


def make(folder: Path) -> list[str] | None:
    block(folder, {"image_points.csv": "# point,image,x,y\n# 1,a1,2,3\n"})
    return None
