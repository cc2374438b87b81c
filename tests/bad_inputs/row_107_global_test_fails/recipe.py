"""Row 107: Image coordinates four times worse than they claim, and a quality gate on sigma0."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.bad_inputs.flown import Row, each, film

CHANCE = np.random.default_rng(11)


def worse(row: Row) -> Row:
    dx, dy = CHANCE.normal(0, 0.02, 2)
    return row | {"x": f"{float(row['x']) + dx:.4f}", "y": f"{float(row['y']) + dy:.4f}"}


def make(folder: Path) -> list[str] | None:
    film(folder, each("image_points.csv", worse))
    with (folder / "pipeline.yaml").open("a", encoding="utf-8") as file:
        file.write("gates: {bundle: {sigma0: {max: 1.5}}}\n")
    return None
