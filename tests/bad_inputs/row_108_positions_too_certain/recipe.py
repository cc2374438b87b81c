"""Row 108: Positions that claim 5 cm and are good to 40 cm."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.bad_inputs.flown import Row, each, film

CHANCE = np.random.default_rng(12)


def worse(row: Row) -> Row:
    return row | {axis: f"{float(row[axis]) + CHANCE.normal(0, 0.4):.3f}" for axis in "XYZ"}


def make(folder: Path) -> list[str] | None:
    film(folder, each("exterior.csv", worse))
    return None
