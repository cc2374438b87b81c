"""Row 64: Two strips with two points in common."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import Row, each, film


def apart(row: Row) -> Row:
    kept = row["image"].startswith("01") or row["point"] in ("GCP06", "GCP07")
    return row if kept else row | {"point": "b" + row["point"]}


def make(folder: Path) -> list[str] | None:
    film(folder, each("image_points.csv", apart), until="bundle")
    return None
