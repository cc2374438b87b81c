"""Legal blocks of all kinds end well, or with the error they must have: every pair of levels of two factors.

Blocks, a dense network that says what is determined, and what counts as an end: tests/campaigns/legal; random ones and
more of them: `python -m tests.campaigns.legal_blocks --count 2000`.
"""

import itertools
from collections.abc import Iterator

import pytest
from _pytest.mark.structures import ParameterSet

from tests.campaigns.legal.cell import FACTORS, Cell, cell_of, covering
from tests.campaigns.legal.folder import WAYS
from tests.campaigns.legal.judged import end_of

ONCE_LOST = (
    # two strips whose common points leave a rotation open stand by themselves, each on its control
    "control=full positions=all attitudes=all tilt=0 camera=digital parameters=removable sigmas=fifth wrong=parallel "
    "seed=100079 sigmas_of=image noise=normal",
    # one of two control points is wrong in all coordinates: positions of a strip, of six parameters, were blamed for it
    "control=two positions=all attitudes=none tilt=40 camera=digital parameters=removable sigmas=fifth wrong=control "
    "seed=300178 sigmas_of=control noise=normal",
    # two positions that nothing tells apart, one of them just beyond the limit by standard deviations half too small
    "control=full positions=all attitudes=all tilt=15 camera=digital parameters=fixed sigmas=half wrong=control "
    "seed=300007 sigmas_of=position noise=normal",
    # ten additional parameters explain a wrong control point nearly as well as another one does; without those that are
    # not worth keeping it is clear
    "control=two positions=some attitudes=all tilt=5 camera=digital parameters=removable sigmas=half wrong=control "
    "seed=500007 sigmas_of=position noise=normal",
    # rays that are parallel but for noise: a point 990 km below the ground, and not a word
    "control=perimeter positions=none attitudes=none tilt=5 camera=digital parameters=fixed sigmas=right "
    "wrong=parallel seed=1 sigmas_of=image noise=normal",
    # strips of known attitudes, each with one control point, that share one or two points: no scale of their own
    "control=two positions=none attitudes=all tilt=0 camera=digital parameters=free sigmas=right wrong=weak "
    "seed=30760 sigmas_of=control noise=normal",
    "control=two positions=none attitudes=all tilt=40 camera=film parameters=removable sigmas=right wrong=weak "
    "seed=30535 sigmas_of=image noise=normal",
    # control that a single ray of a strip shows gives its scale
    "control=two positions=none attitudes=all tilt=40 camera=digital parameters=fixed sigmas=right wrong=weak "
    "seed=30941 sigmas_of=control noise=normal",
    # a strip of a wrong model is left out, and those beside it, of positions on a line each, begin level
    "control=none positions=all attitudes=none tilt=5 camera=digital parameters=fixed sigmas=half wrong=weak "
    "seed=31008 sigmas_of=control noise=normal",
    # points that were lost while a wrong position bent the block come back when it has gone
    "control=two positions=some attitudes=all tilt=15 camera=film parameters=free sigmas=fifth wrong=position "
    "seed=30695 sigmas_of=position noise=normal",
    # a strip without a scale beside strips that are placed by attitudes
    "control=two positions=none attitudes=all tilt=0 camera=film parameters=removable sigmas=fifth wrong=weak "
    "seed=41314 sigmas_of=all noise=normal",
)
"""Random cells that ended badly at some time."""

CELLS = [*covering(), *map(cell_of, ONCE_LOST)]


def test_every_pair_of_levels_occurs() -> None:
    for a, b in itertools.combinations(FACTORS, 2):
        assert {(getattr(c, a), getattr(c, b)) for c in CELLS} == set(itertools.product(FACTORS[a], FACTORS[b]))


SECONDS = {"1-gross-chain", "2-control-graph"}
"""Cells that take more than two."""


def _cases() -> Iterator[ParameterSet]:
    """Every cell both ways; of the quick tests every third cell one way, the two in turn."""
    for k, cell in enumerate(CELLS):
        for j, way in enumerate(WAYS):
            name = f"{cell.seed}-{cell.wrong}-{way}"
            is_quick = k % 3 == 0 and j == k % len(WAYS) and name not in SECONDS
            marks = () if is_quick else (pytest.mark.slow,)
            yield pytest.param(cell, way, id=name, marks=marks)


@pytest.mark.parametrize(("cell", "way"), [*_cases()])
def test_a_legal_block_ends_well_or_with_the_error_it_must_have(cell: Cell, way: str) -> None:
    end = end_of(cell, way)
    assert end.outcome in ("good", "aside", "refused"), f"--ways {way} --cell '{cell}'\n{end.outcome}: {end.why}"
