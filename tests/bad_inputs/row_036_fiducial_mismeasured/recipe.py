"""Row 36: One fiducial mark measured 0.1 mm off."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import film, moved


def make(folder: Path) -> list[str] | None:
    film(
        folder,
        moved("fiducials.csv", lambda row: (row["image"], row["fiducial"]) == ("0102", "3"), x=0.1),
        until="interior",
    )
    return None
