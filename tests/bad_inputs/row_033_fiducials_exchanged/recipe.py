"""Row 33: Two fiducial marks of an image with their numbers exchanged."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import Row, each, film


def exchanged(row: Row) -> Row:
    other = {"1": "2", "2": "1"}.get(row["fiducial"], row["fiducial"])
    return row | {"fiducial": other} if row["image"] == "0102" else row


def make(folder: Path) -> list[str] | None:
    film(folder, each("fiducials.csv", exchanged), until="interior")
    return None
