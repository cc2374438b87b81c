"""Row 17: Two images that differ in case only: a warning."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import FILES, block


def make(folder: Path) -> list[str] | None:
    names = ("images.csv", "image_points.csv", "fiducials.csv", "exterior.csv")
    change = {n: FILES[n].replace("day 1,cloud", "day 1,").replace(chr(10) + "a2,", chr(10) + "A1,") for n in names}
    block(folder, change | {"image_points.csv": FILES["image_points.csv"].replace(",a2,", ",A1,")})
    return None
