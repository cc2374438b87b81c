"""A group whose estimate lies within its own standard deviations is no finding."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from aatri.adapters.bundle.bundle_input import bundle_input, observation_source
from aatri.adjustment.statistics.limits import ALARM
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.groups.score_tests import is_significant, most_fit_better, share_without_largest
from aatri.orientation.bundle.groups.search import _rejected_before
from aatri.stages.bundle_adjustment.bundle import BundleOptions
from tests.stages.bundle_adjustment.test_bundle_input import exterior_rows
from tests.stages.hand_block import ground_rows, hand, read, start


@pytest.mark.parametrize(
    ("value", "sigma", "significant"),
    [([-0.192], [1.9], False), ([0.0107, 0.0031], [0.006, 0.0034], False), ([0.03, 0.0], [0.006, 0.0034], True)],
)
def test_what_lies_within_its_standard_deviations_is_none(
    value: list[float], sigma: list[float], significant: bool
) -> None:
    assert is_significant(np.array(value), np.diag(np.square(sigma))) is significant


def test_parameters_are_judged_together_whatever_their_units() -> None:
    """Each within two sigmas, but of opposite signs though correlated by 0.99: d^2 = 2 t^2 / (1 - rho)."""
    units = np.array([1e-6, 1e3])
    C = np.array([[1.0, 0.99], [0.99, 1.0]])
    value = np.array([1.5, -1.5])
    assert chi2.isf(ALARM, 2) < 2 * 1.5**2 / (1 - 0.99)
    assert is_significant(units * value, np.outer(units, units) * C)
    assert not is_significant(units * np.abs(value), np.outer(units, units) * C)


def test_where_no_covariance_is_known_nothing_is_dropped() -> None:
    assert is_significant(np.zeros(2), np.full((2, 2), np.nan))


def test_one_wrong_member_that_carries_others_along_is_no_group() -> None:
    """Two points of two rays each move with it along their bases, where nothing holds them: nothing is gained."""
    before, after = np.array([[80.0, 0.0], [0.5, 0.9], [1.1, -0.3]]), np.array([[0.2, 0.0], [0.5, 0.8], [1.1, -0.3]])
    assert share_without_largest(before, after) == pytest.approx((0.9**2 - 0.8**2) / (80**2 - 0.2**2 + 0.9**2 - 0.8**2))
    together = np.array([[9.0, 0.0], [8.0, 1.0], [0.0, 10.0]])
    assert share_without_largest(together, np.zeros((3, 2))) == pytest.approx((81 + 65) / (81 + 65 + 100))


def test_what_most_members_absorb_is_judged_by_those_that_it_changes() -> None:
    """A wrong lens that control contradicts: 60 rays feel it, 2,000 change by a hundredth."""
    rng = np.random.default_rng(4)
    rays = rng.standard_normal((2000, 2))
    absorbed = 1e-2 * np.sign(rays) * np.where(np.arange(2000) % 20 < 11, 1.0, -1.0)[:, None]
    felt = rng.choice([-2.0, 2.0], (60, 2))
    before, after = np.concatenate([rays, felt]), np.concatenate([rays + absorbed, 0.1 * felt])
    assert most_fit_better(before, after, absorbed=True)
    assert not most_fit_better(before, after)
    assert not most_fit_better(before, np.concatenate([rays + absorbed, 1.5 * felt]), absorbed=True)


def test_two_wrong_members_of_ten_that_shift_all_of_them_are_no_group() -> None:
    before = np.zeros((10, 1))
    before[:2] = 5.0
    assert not most_fit_better(before, before - 1.0)
    assert most_fit_better(before + 3.0, before)


def test_several_that_were_rejected_are_tried_again_of_the_kind_that_has_them(tmp_path: Path) -> None:
    """Positions and attitudes concern images alone, control points alone; rays concern both, and stay out."""
    of = hand()
    exterior = exterior_rows(of, None, tail=",0.1,0.1,0.1", head=",sX,sY,sZ")
    block, points = read(tmp_path, of, ground=ground_rows(of, (0, 5, 24, 29)), exterior=exterior)
    observed = bundle_input(observation_source(block, points, start(of, block)), BundleOptions()).observed

    def again(kind: str, count: int) -> list[str]:
        return _rejected_before([o.without(np.arange(len(o)) < count * (o.kind == kind)) for o in observed])

    assert (again("control", 3), again("position", 3)) == ([POINT], [POSE])
    assert (again("control", 2), again("image_point", 9)) == ([], [])
