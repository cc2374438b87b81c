"""Positions of which all stand a row off in their table, as the initial orientation finds: the bundle does without."""

from __future__ import annotations

import pytest

from aatri.artifacts.solution import Solution
from tests.campaigns.legal.cell import cell_of
from tests.campaigns.legal.flight import scene_of
from tests.campaigns.legal.judged import Ear, read, through

CELL = "control=full positions=all attitudes=none tilt=0 camera=digital parameters=fixed sigmas=right wrong=nothing"


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 3])
def test_what_no_group_explains_stays_out_where_all_else_fits_far_better(seed: int) -> None:
    cell, ear = cell_of(f"{CELL} seed={seed}"), Ear()
    scene = scene_of(cell)
    scene.positions_m, scene.positioned = scene.positions_m[1:], scene.positioned[:-1]
    solution = through(cell, read(scene, ear), "graph", ear)["bundle"]
    assert isinstance(solution, Solution)
    assert any("stand one row off" in text for text in ear.warnings)
    assert any("stays out: all else fits far better" in text for text in ear.warnings)
    assert solution.images.oriented.all()
    assert solution.sigma0 < 1.1
