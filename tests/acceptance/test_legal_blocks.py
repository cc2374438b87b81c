"""Legal blocks of all kinds end well, or with the error they must have: every pair of levels of two factors.

The chain of stages, the one of strips or the one for images without order, is a factor, too.

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
)
"""Random cells that ended badly at some time."""


def _ways(cells: list[Cell]) -> Iterator[tuple[Cell, str]]:
    """Each cell one way, the one that more of its levels have not gone yet; the less gone one of two alike."""
    gone: list[tuple[str, str, str]] = []

    def is_known(cell: Cell, way: str) -> tuple[int, int]:
        levels = [(name, getattr(cell, name), way) in gone for name in FACTORS]
        return sum(levels), sum(other == way for *_, other in gone)

    for cell in cells:
        way = min(WAYS, key=lambda way: is_known(cell, way))
        gone += [(name, getattr(cell, name), way) for name in FACTORS]
        yield cell, way


CASES = [*_ways(covering()), *itertools.product(map(cell_of, ONCE_LOST), WAYS)]


def test_every_pair_of_levels_occurs() -> None:
    for a, b in itertools.combinations(FACTORS, 2):
        assert {(getattr(c, a), getattr(c, b)) for c, _ in CASES} == set(itertools.product(FACTORS[a], FACTORS[b]))
    for a, levels in FACTORS.items():
        assert {(getattr(c, a), way) for c, way in CASES} == set(itertools.product(levels, WAYS))


SECONDS = {"1-gross-chain"}
"""Cases that take more than two."""


def _cases() -> Iterator[ParameterSet]:
    """Every third case is among the quick tests."""
    for k, (cell, way) in enumerate(CASES):
        name = f"{cell.seed}-{cell.wrong}-{way}"
        marks = () if k % 3 == 0 and name not in SECONDS else (pytest.mark.slow,)
        yield pytest.param(cell, way, id=name, marks=marks)


@pytest.mark.parametrize(("cell", "way"), [*_cases()])
def test_a_legal_block_ends_well_or_with_the_error_it_must_have(cell: Cell, way: str) -> None:
    end = end_of(cell, way)
    assert end.outcome in ("good", "aside", "refused"), f"--ways {way} --cell '{cell}'\n{end.outcome}: {end.why}"
