"""Row 58: A strip whose halves have nothing in common."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import Row, each, film


def apart(row: Row) -> Row:
    return row | {"point": "b" + row["point"]} if row["image"] in ("0103", "0104") else row


def make(folder: Path) -> list[str] | None:
    film(folder, each("image_points.csv", apart), until="strips", block="max_reject_share: 0.3")
    return None
