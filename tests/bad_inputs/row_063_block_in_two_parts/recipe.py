"""Row 63: Strips that have no point in common, one of them without control."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import Row, each, film, without


def apart(row: Row) -> Row:
    return row | {"point": "b" + row["point"]} if row["image"].startswith("02") else row


def make(folder: Path) -> list[str] | None:
    film(
        folder,
        without("exterior.csv"),
        each("image_points.csv", apart),
        until="absolute",
        refined="refraction: false, earth_curvature: false",
    )
    return None
