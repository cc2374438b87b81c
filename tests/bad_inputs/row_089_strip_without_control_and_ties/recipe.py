"""Row 89: A strip without control, tied to the other by two points."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import Row, each, film, without


def apart(row: Row) -> Row:
    kept = row["image"].startswith("01") or row["point"] in ("GCP06", "GCP07")
    return row if kept else row | {"point": "b" + row["point"]}


def make(folder: Path) -> list[str] | None:
    film(
        folder,
        without("exterior.csv"),
        each("image_points.csv", apart),
        until="strip_block",
        refined="refraction: false, earth_curvature: false",
    )
    return None
