"""Positions of which all stand a row off in their table, as the initial orientation finds: the bundle does without."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.artifacts.solution import Solution
from tests.campaigns.legal.cell import cell_of
from tests.campaigns.legal.flight import scene_of
from tests.campaigns.legal.judged import Ear, lost_of, read, through

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
