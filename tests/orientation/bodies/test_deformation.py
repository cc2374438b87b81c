"""What is told of sigma0 of whole strips."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from aatri.errors import ConvergenceError
from aatri.orientation.bodies.deformation import Misfit, bends_far_less, expected_ratio, sigma0_notes
from aatri.orientation.bodies.limits import MISFIT_OF_RIGHT


def _levels(*weighted: float, redundancy: int = 400) -> list[str]:
    tied = [SimpleNamespace(weighted_sigma0=w, redundancy=redundancy, tau_m=0.1) for w in weighted]
    names = [f"component {k}" for k in range(len(tied))]
    return [note.level for note in sigma0_notes(tied, names, 1.0, 20, Misfit(20.0, 500.0), 1.0, "strip block")]


def test_noise_summed_twice_has_the_size_expected_of_strips() -> None:
    """By random walks of random walks, less their best shift and tilt; 0.049 n^1.5 on the mean."""
    rng = np.random.default_rng(3)
    n = 60
    walks = np.cumsum(np.cumsum(rng.normal(size=(4000, n)), axis=1), axis=1)
    line = np.polynomial.polynomial.polyvander(np.arange(n), 1)
    left = walks - (line @ np.linalg.lstsq(line, walks.T, rcond=None)[0]).T
    assert expected_ratio(n) - 1 == pytest.approx(np.sqrt((left**2).mean()), rel=0.05)


def test_strips_that_agree_better_than_their_points_say_are_a_note_and_worse_ones_a_warning() -> None:
    assert "warning" not in _levels(0.6)
    assert "warning" in _levels(1.6)
    assert "warning" not in _levels(1.02)


def test_nothing_is_tested_without_redundancy() -> None:
    assert "warning" not in _levels(float("nan"), redundancy=0)


def _of_two(weighted: float) -> list[str]:
    """Strips tied well, and to the ground by so little that their deformation cannot be told from it."""
    tied = [
        SimpleNamespace(weighted_sigma0=1.0, redundancy=400, tau_m=0.1),
        SimpleNamespace(weighted_sigma0=weighted, redundancy=1, tau_m=0.0),
    ]
    names = ["strips", "ground"]
    return [note.level for note in sigma0_notes(tied, names, 1.0, 20, Misfit(20.0, 500.0), 1.0, "strips")]


def test_strips_that_bend_as_expected_fit_the_ground_where_nothing_tells_how_much_they_bend() -> None:
    assert expected_ratio(20) == pytest.approx(5.4, abs=0.1)
    assert "warning" not in _of_two(5.0)
    assert "warning" in _of_two(20.0)


def _of(sigma0: float, max_sigma0: float | None, off_m: float) -> list[str]:
    misfit = Misfit(max_sigma0, 500.0)
    return [note.level for note in misfit.notes(sigma0, expected_ratio(27), off_m, "strip block", " of 27 models")]


def test_strips_off_by_more_than_any_deformation_are_refused() -> None:
    beyond = 20.0 * expected_ratio(27) + 1.0
    assert _of(beyond - 2.0, 20.0, 100.0) == []
    with pytest.raises(ConvergenceError, match=r"strip block: sigma0 is .* of 27 models"):
        _of(beyond, 20.0, 0.1)
    with pytest.raises(ConvergenceError, match="beyond max_sigma0 = 20"):
        _of(beyond, None, 1.1 * MISFIT_OF_RIGHT * 500.0)


def test_a_misfit_that_is_small_in_metres_is_a_warning_where_no_limit_is_given() -> None:
    assert _of(20.0 * expected_ratio(27) + 1.0, None, 0.9 * MISFIT_OF_RIGHT * 500.0) == ["warning"]


@pytest.mark.parametrize(
    ("without_m", "with_all_m", "redundancy", "far_less"),
    [
        pytest.param(0.19, 1.0, 4, True, id="a fifth of four residuals"),
        pytest.param(0.21, 1.0, 4, False, id="more than a fifth of them"),
        pytest.param(0.0, 1.0, 1, False, id="one residual tells nothing"),
        pytest.param(0.0, 0.0, 4, False, id="none is deformed"),
        pytest.param(0.0, 5.0, 600, True, id="nothing is left of metres, of many"),
        pytest.param(4.9, 5.0, 600, False, id="the same, of many"),
        pytest.param(0.01, 0.3, 700, True, id="a thirtieth, of many"),
        pytest.param(0.978, 1.0, 300, False, id="2 per cent less, of many"),
    ],
)
def test_what_was_left_out_bent_a_body_where_that_is_deformed_far_less_without(
    without_m: float, with_all_m: float, redundancy: int, far_less: bool
) -> None:
    without, with_all = (SimpleNamespace(tau_m=tau_m, redundancy=redundancy) for tau_m in (without_m, with_all_m))
    assert bends_far_less(without, with_all) is far_less
