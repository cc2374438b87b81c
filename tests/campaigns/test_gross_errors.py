"""The campaigns of gross errors, a few blocks of each."""

from __future__ import annotations

import pytest

from tests.campaigns.gross_errors import outcomes
from tests.campaigns.pair_of_the_notes import outcome


def test_the_errors_of_the_notes_pair_are_found_and_measured_and_nobody_else_is_blamed() -> None:
    recall, alarms, rms = outcome(1)
    assert recall >= 0.95
    assert alarms <= 2
    assert 0.6 < rms < 1.4  # of some 52 deviations, four standard deviations of it


def test_with_six_control_points_no_ray_is_blamed_for_the_other() -> None:
    _, alarms, _ = outcome(1, control=6)
    assert alarms <= 2


@pytest.mark.slow
def test_gross_errors_in_the_demo_leave_it_as_good_as_without() -> None:
    for name, figures, bad in outcomes(1, ["image_points", "swapped_numbers"]):
        assert not bad, (name, figures)
        assert figures["found"] >= 0.98 * figures["wrong"], name
