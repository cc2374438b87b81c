"""Positions that are wrong as rows of a table: of a receiver that stands still, or all a row off."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.solution import Solution
from tests.campaigns.legal.cell import cell_of
from tests.campaigns.legal.flight import scene_of
from tests.campaigns.legal.judged import Ear, lost_of, read, through
from tests.small_blocks import adjusted_by, flown, off_m


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_wrong_positions_are_rejected_and_no_image_is_lost_with_them(tmp_path: Path, seed: int) -> None:
    """With three rejected positions taken back four images begin in one place, and least squares set them aside."""
    small = flown(strips=3, per_strip=6, seed=seed, points=14, apart_m=600.0)
    folder = small.write(tmp_path / "block")
    rows = [line.split(",") for line in (folder / "exterior.csv").read_text().splitlines()]
    place = next(row[1:4] for row in rows if row[0] == "301")
    for row in rows:
        row[1:4] = place if row[0] in ("302", "303", "304") else row[1:4]
    (folder / "exterior.csv").write_text("\n".join(",".join(row) for row in [*rows, [""]]))
    done = adjusted_by("graph", folder)
    assert done.bundle.images.oriented.all()
    assert off_m(small, done.bundle) < 0.5
    s = done.bundle.suspects
    assert set(s.image[(s.kind == "position") & s.staying_out].tolist()) == {"302", "303", "304"}


CELL = "positions=all attitudes=none parameters=fixed sigmas=right wrong=nothing"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("way", "levels"),
    [
        ("graph", "control=full camera=digital tilt=0 seed=2"),
        ("graph", "control=full camera=digital tilt=5 seed=1"),
        ("graph", "control=full camera=digital tilt=0 seed=11"),
        ("graph", "control=perimeter camera=digital tilt=0 seed=25"),
        ("chain", "control=perimeter camera=film tilt=15 seed=28"),
    ],
)
def test_they_stay_out_where_no_group_explains_them_and_nothing_else_does(way: str, levels: str) -> None:
    cell, ear = cell_of(f"{CELL} {levels}"), Ear()
    scene = scene_of(cell)
    if way == "graph":
        scene.positions_m, scene.positioned = scene.positions_m[1:], scene.positioned[:-1]
    else:
        scene.positions_m = np.roll(scene.positions_m, 1, axis=0)
    scene.wrong_positions = np.arange(len(scene.positioned))
    block = read(scene, ear)
    solution = through(cell, block, way, ear)["bundle"]
    assert isinstance(solution, Solution)
    assert any("stand one row off" in text for text in ear.warnings)
    assert solution.images.oriented.all()
    assert solution.sigma0 < 1.1
    assert lost_of(scene, block, solution)[0] == 0
