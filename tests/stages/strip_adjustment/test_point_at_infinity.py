"""A point of parallel rays in a strip: nothing places it, and it is no reason to give the strip up."""

from __future__ import annotations

import pytest

from tests.campaigns.legal.cell import cell_of
from tests.campaigns.legal.judged import end_of

CELL = (
    "control=two positions=none attitudes=all tilt=40 camera=film parameters=removable sigmas=fifth wrong=parallel "
    "seed=8868 sigmas_of=all noise=normal"
)
"""Its rays meet at 120,000 bases, known to six times that along the ray and to three bases across."""


@pytest.mark.slow
def test_a_point_at_infinity_costs_no_strip() -> None:
    assert end_of(cell_of(CELL), "chain").outcome == "good"
