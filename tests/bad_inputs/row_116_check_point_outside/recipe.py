"""Row 116: A check point outside of the control."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import each, film


def make(folder: Path) -> list[str] | None:
    film(
        folder,
        each("ground_points.csv", lambda row: row | {"role": "check"} if row["point"] == "GCP04" else row),
        until="accuracy",
    )
    return ["run"]
