"""Positions of which all stand a row off in their table, as the initial orientation finds: the bundle does without."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.artifacts.solution import Solution
from tests.campaigns.legal.cell import cell_of
from tests.campaigns.legal.flight import scene_of
from tests.campaigns.legal.judged import Ear, lost_of, read, through

CELL = "control=full positions=all attitudes=none camera=digital parameters=fixed sigmas=right wrong=nothing"


@pytest.mark.slow
@pytest.mark.parametrize(("tilt", "seed"), [(0, 2), (0, 3), (5, 1), (0, 11)])
def test_they_stay_out_where_no_group_explains_them_and_nothing_else_does(tilt: int, seed: int) -> None:
    cell, ear = cell_of(f"{CELL} tilt={tilt} seed={seed}"), Ear()
    scene = scene_of(cell)
    scene.positions_m, scene.positioned = scene.positions_m[1:], scene.positioned[:-1]
    scene.wrong_positions = np.arange(len(scene.positioned))
    block = read(scene, ear)
    solution = through(cell, block, "graph", ear)["bundle"]
    assert isinstance(solution, Solution)
    assert any("stand one row off" in text for text in ear.warnings)
    assert solution.images.oriented.all()
    assert solution.sigma0 < 1.1
    assert lost_of(scene, block, solution)[0] == 0
