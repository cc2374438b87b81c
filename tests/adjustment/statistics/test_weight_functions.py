"""Weight functions against their published forms, and the tau test against its own distribution."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment.statistics.tau import tau_limit
from aatri.adjustment.statistics.weight_functions import BOUNDS, FLOOR, weights


@pytest.mark.parametrize(
    ("name", "s", "expected"),
    [
        ("huber", 8.0, 0.25),  # 2 / 8
        ("danish", 4.0, np.exp(-3.0)),  # (4 / 2)^2 = 4
        ("igg3", 4.0, 0.5 * (0.5) ** 2),  # k 2, k1 6: 2/4 ((6 - 4) / 4)^2
        ("igg3", 7.0, FLOOR),
        ("li_posterior", 5.0, 0.04),
        ("cauchy", 6.0, 0.1),  # 1 / (1 + 3^2)
    ],
)
def test_weights_with_the_bound_two_are_the_published(name: str, s: float, expected: float) -> None:
    assert weights(name, np.array([s]), 2.0)[0] == pytest.approx(expected, rel=1e-12)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", list(BOUNDS))
def test_weights_fall_from_one_and_their_cost_is_concave_in_the_square(name: str) -> None:
    s = np.linspace(0.0, 30.0, 3001)
    w = weights(name, s, BOUNDS[name])  # type: ignore[index,arg-type]
    assert w[0] == 1.0
    assert (np.diff(w) <= 0).all()
    assert (w >= FLOOR).all()


@pytest.mark.parametrize("redundancy", [3, 10, 100])
def test_the_limit_of_tau_is_exceeded_as_often_as_that_of_w(redundancy: int) -> None:
    """tau of one of r independent residuals: x1 / rms(x); the share beyond is 1 % within 3 sigma of 400,000 samples."""
    x = np.random.default_rng(7).standard_normal((400_000, redundancy))
    tau = x[:, 0] / np.sqrt((x**2).mean(axis=1))
    beyond = (np.abs(tau) > tau_limit(2.5758293035489, redundancy)).mean()
    assert abs(beyond - 0.01) < 3 * np.sqrt(0.01 * 0.99 / 400_000)


def test_without_redundancy_nothing_is_beyond() -> None:
    assert tau_limit(4.0, 1) == np.inf
