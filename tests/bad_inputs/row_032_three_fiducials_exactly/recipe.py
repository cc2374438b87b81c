"""Row 32: Just as many fiducial marks as an affine transformation needs."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import each, film


def make(folder: Path) -> list[str] | None:
    film(
        folder,
        each("fiducials.csv", lambda row: None if (row["image"], row["fiducial"]) == ("0102", "3") else row),
        until="interior",
    )
    return None
