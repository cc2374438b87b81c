"""Row 102: A bundle that starts from orientations turned by 120 degrees."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import Row, digital, each
from tests.bad_inputs.kit import pipeline

START = """\
  block: {use: block/tables, with: {path: block}}
  interior: {use: interior_orientation/calibrated, from: {block}}
  bundle: {use: bundle_adjustment/bundle, from: {block, image_points: interior}}
"""


def turned(row: Row) -> Row:
    return row | {"a1": "2.1", "a2": "0", "a3": "0"}


def make(folder: Path) -> list[str] | None:
    digital(folder, each("exterior.csv", turned), until="interior")
    pipeline(folder, START)
    return None
