"""Row 7: CRLF, CR and no last line end: read."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import FILES, block


def make(folder: Path) -> list[str] | None:
    block(
        folder,
        {
            "images.csv": FILES["images.csv"].replace("\n", "\r\n").encode(),
            "image_points.csv": FILES["image_points.csv"].replace("\n", "\r").strip().encode(),
        },
    )
    return None
