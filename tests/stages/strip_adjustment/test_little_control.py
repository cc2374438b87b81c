"""Strip adjustment of blocks that positions alone, or little more, bring to the ground."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.stages.absolute_orientation.similarity import similarity
from aatri.stages.strip_adjustment.conformal import ConformalOptions, conformal
from aatri.stages.strip_adjustment.polynomial import PolynomialOptions, polynomial
from tests.made_strips import Heard, MadeBlock

METHODS = {"polynomial": (polynomial, PolynomialOptions), "conformal": (conformal, ConformalOptions)}


def _oriented(control, noise_m: float = 0.02):
    """Two strips with a position for every image, and a few control points."""
    made = MadeBlock(2, 5, noise_m=noise_m)
    made.control(control)
    made.positions(range(len(made.truth_X0)))
    block, points, strips = made.block(), made.image_points(), made.strips()
    return made, (block, points, strips, similarity(block, strips, points))


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("control", [(), (3,), (3, 40), (3, 20, 40)])
def test_positions_and_little_or_no_control_give_a_block(name: str, control) -> None:
    made, given = _oriented(control)
    heard = Heard()
    solution = METHODS[name][0](*given, context=heard)
    assert solution.images.oriented.all()
    assert np.sqrt(np.nanmean((solution.points.xyz_m - made.truth) ** 2)) < 0.1
    assert not any("degree" in text for text in heard.warnings)  # nobody has asked for one
    if not control:
        assert np.array_equal(np.isfinite(solution.points.xyz_m), np.isfinite(given[3].points.xyz_m))
        assert any("no strip is corrected" in line for line in heard.lines)


@pytest.mark.parametrize("name", METHODS)
def test_a_degree_that_is_asked_for_and_falls_is_a_warning(name: str) -> None:
    _, given = _oriented((3,))
    method, options = METHODS[name]
    heard = Heard()
    method(*given, options=options(degree=2), context=heard)
    assert any("height" in text and "degree 2: rank" in text for text in heard.warnings)
