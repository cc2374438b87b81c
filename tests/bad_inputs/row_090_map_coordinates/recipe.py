"""Row 90: Strip polynomials in large map coordinates: they are reduced, nothing is lost."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import every, film, moved


def make(folder: Path) -> list[str] | None:
    film(folder, moved("ground_points.csv", every, X=38e6), moved("exterior.csv", every, X=38e6), until="strip_block")
    return None
