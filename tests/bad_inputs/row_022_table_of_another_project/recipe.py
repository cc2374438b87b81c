"""Row 22: Control of another project, in which the same ids are other points."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import every, film, moved


def make(folder: Path) -> list[str] | None:
    film(folder, moved("ground_points.csv", every, X=3100.0, Y=1250.0, Z=40.0), until="absolute")
    return None
