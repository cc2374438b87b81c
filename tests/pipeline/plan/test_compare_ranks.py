"""What changed most stands first."""

from __future__ import annotations

import pytest

from aatri.pipeline.plan.compare import relative_spread


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ((1.0, 1.0), 0.0),
        ((1.0, 2.0), 0.5),
        ((-1.0, 1.0), 2.0),
        ((0, 0), 0.0),
        ((None, 1.0), float("inf")),
        ((10, 11, 8), 3 / 11),
    ],
)
def test_the_spread_of_a_figure_is_relative(values, expected):
    assert relative_spread(values) == pytest.approx(expected)
