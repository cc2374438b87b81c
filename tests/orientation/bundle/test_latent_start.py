"""A block with a sphere of unknown radius whose images begin 10 m off: the sphere of the start is another one."""

from __future__ import annotations

from tests.campaigns.kinds import one_block


def test_shapes_are_fitted_anew_where_the_start_of_their_points_is_far_off() -> None:
    found = one_block("relative sphere", 82)
    assert 0.7 < found.squares / found.redundancy < 1.3
    assert found.of_points < 2.0
