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

ALARM = 0.001
"""Chance that a kind of test - of sigma0, of classes, groups, terrain, a click - tells anything where nothing is wrong,
shared by all tests of that kind."""

MEDIAN_OF_NORMAL = 0.67449
"""Median of the absolute value of a standard normal variable."""

MEDIAN_SQUARE_OF_PLANE = 1.38629
"""Median of the square of a normal error in the plane of variance 1 in each coordinate: 2 ln 2."""

SHOWN = 0.05
"""Probability outside an interval that is told beside a figure."""

POWER = 0.8
"""A detectable error or displacement is found with this probability."""

LEAST_CONTROLLED = 0.01
"""Redundancy number below which no gross error can be seen: one of 41 standard deviations is found in 80 %."""

LEAST_LIMIT = 4.0
"""Of several tests together, and of check points: of normal errors one in 16,000 is beyond."""

SINGLE_LIMIT = 3.29
"""Limit of a single test at the level 0.1 %."""

SEPARABLE = 10.83
"""Difference of e'e below which two explanations cannot be told apart: chi-square of one degree at `ALARM`."""

CLEAR_SIGMAS = 3.0
"""An effect larger than so many of its standard deviations is there: 0.3 % of normal errors are beyond."""

WEAK_DATUM = 10.0
"""Standard deviations of points over what an image point measures on the ground. Regular blocks with control at their
edges have 1 to 4, whatever their size (Ackermann 1966; Ebner 1972)."""

OFF_SIGMAS = 5.0
"""Rotations and attitudes so far off contradict the rest: of normal errors of three components one in 65,000."""

WRONG_SIGMAS = 6.0
"""What is so far off is wrong: single values once in 5e8, rotations (three components) once in 13 million by chance."""


def limit_of_tests(tests: int, false_alarm: float = FALSE_ALARM) -> float:
    """Limit of |w| for so many tests together.

    Parameters
    ----------
    tests : int
        Components tested.
    false_alarm : float
        Probability that one of them is beyond it where nothing is wrong.

    Examples
    --------
    Few tests have the least limit; of a million one is beyond 6.11 with a probability of 0.1 %:

    >>> limit_of_tests(100), round(limit_of_tests(1_000_000, 0.001), 2)
    (4.0, 6.11)
    """
    return max(LEAST_LIMIT, float(-ndtri(0.5 * false_alarm / max(tests, 1))))


def expected_beyond(limit: float, tests: int) -> float:
    """How many of so many tests chance alone brings beyond a limit.

    Examples
    --------
    >>> round(expected_beyond(3.0, 1000), 1)
    2.7
    """
    return float(2.0 * ndtr(-limit) * tests)
