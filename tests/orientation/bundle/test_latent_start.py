"""A block with a sphere of unknown radius whose images begin 10 m off: the sphere of the start is another one."""

from __future__ import annotations

import pytest

from tests.campaigns.kinds import TOGETHER, one_block


def test_shapes_are_fitted_anew_where_the_start_of_their_points_is_far_off() -> None:
    found = one_block("relative sphere", 82)
    assert 0.7 < found.squares / found.redundancy < 1.3
    assert found.of_points < 2.0


@pytest.mark.slow
def test_a_cylinder_begins_at_the_axis_that_fits_its_points_and_its_radius() -> None:
    """Another one, through points a few decimetres off, has a minimum of its own."""
    found = one_block(TOGETHER, 3)
    assert 0.9 < found.squares / found.redundancy < 1.1
