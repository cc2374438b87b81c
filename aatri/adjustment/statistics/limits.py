"""The limit of |w| counts the tests made: with a million of them, four standard deviations are chance.

Of n tests of a block in which nothing is wrong the largest is beyond the limit k with a probability of at most

    n 2 (1 - Phi(k)) = FALSE_ALARM        (Bonferroni's bound, also for dependent tests)

Below some 160 tests k stays 4, and the probability is smaller still: standard deviations of small networks are seldom
known so well that less could be told from chance. Whoever states a limit gets that one.

Source: Baarda 1968 (single tests); Miller 1981, Simultaneous Statistical Inference (many).
"""

from scipy.special import ndtr, ndtri

FALSE_ALARM = 0.01
"""Chance that anything is rejected of a block in which nothing is wrong."""

LEAST_LIMIT = 4.0

SINGLE_LIMIT = 3.29
"""Limit of a single test at the level 0.1 %."""


def limit_of_tests(tests: int, false_alarm: float = FALSE_ALARM) -> float:
    """Limit of |w| for so many tests together.

    Parameters
    ----------
    tests : int
        Components tested.
    false_alarm : float
        Probability that one of them is beyond it where nothing is wrong.
    """
    return max(LEAST_LIMIT, float(-ndtri(0.5 * false_alarm / max(tests, 1))))


def expected_beyond(limit: float, tests: int) -> float:
    """How many of so many tests chance alone brings beyond a limit."""
    return float(2.0 * ndtr(-limit) * tests)
