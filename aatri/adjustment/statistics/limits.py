"""The limit of |w| counts the tests made: with a million of them, four standard deviations are chance.

Of n tests of a block in which nothing is wrong the largest is beyond the limit k with a probability of at most

    n 2 (1 - Phi(k)) = FALSE_ALARM        (Bonferroni's bound, also for dependent tests)

Below some 160 tests k stays 4, and the probability is smaller still: standard deviations of small networks are seldom
known so well that less could be told from chance. Whoever states a limit gets that one.

Source: Baarda 1968 (single tests); Miller 1981, Simultaneous Statistical Inference (many).
"""

from scipy.special import chdtri, ndtr, ndtri

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
"""Probability that a figure lies outside the interval told beside it."""

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
"""Standard deviations of a rotation or attitude from which on it contradicts the rest: of normal errors of three
components one in 65,000."""

WRONG_SIGMAS = 6.0
"""Standard deviations of an observation or rotation from which on it is wrong: by chance single values once in 5e8,
rotations (three components) once in 13 million."""

# --- global test

MAX_SIGMA0 = 20.0
"""sigma0 beyond which an adjustment has not described its observations, whatever its iteration says."""

COARSEST_RAD = 1e-3
"""Standard deviation of directions from which on nobody measures. Chosen, without a source: two pixels where a right
angle is 4,000 pixels wide (c = 2,000 pixels); film measured to 6 um at 150 mm has a 25th of it."""

WARNED_BEYOND = (0.8, 1.25)
"""sigma0 outside of these is a warning, where chance does not explain it: standard deviations are seldom known
better."""

FAR_BEYOND = (0.5, 2.0)
"""sigma0 outside of these: the standard deviations of a result say nothing."""

# --- class scales

MATTERS = WARNED_BEYOND[1]
"""Scale of standard deviations up to which they are as good as right for tests."""

LIMIT_OF_SCALES = float(chdtri(1.0, 2.0 * ALARM))
"""Limit of the likelihood ratio of the scale of a class, one-sided."""

UNTESTED_REDUNDANCY = 0.5
"""Redundancy up to which nothing tests the others without one record: any of three control points may be wrong."""

# --- attribution

CONTROLLED_COMPONENT = 1e-3
"""Redundancy number of a component of an observation below which it is not tested."""

MOST_FOR_PAIRS = 14
"""Records (observations of one object) of a block up to which pairs of wrong ones are tried."""

# --- leave one out

CONTROLLED_DIRECTION = 1e-9
"""Directions of a record with a smaller redundancy are explained by nothing."""

AS_GOOD_GAIN = 0.02
"""Share by which the gain of leaving out another observation may fall short of the best and still explain the same: the
model is linear so far only."""

# --- exchanged

SHARE_REJECTED, SHARE_AT_START = 0.05, 0.2
"""Two points are exchanged if that leaves this share of their distances: rejected ones, at the start."""

MOST_FOR_EXCHANGE = 40
"""Where more points than these are off, it is no matter of two numbers."""

# --- long tails

LEAST_FREEDOM = 4.0
"""Degrees of freedom of the longest tail that is fitted."""

BEYOND_TAIL = 5e-5
"""Share of good components beyond the limit, where nu is known: of observations of two at most a tenth of the one in a
thousand that may be lost, for in small blocks nu is known badly (campaign `false_alarms`)."""

TAIL_REACH = 1.25
"""Limits up to which residuals tell of the tail: gross errors that lie so near do no harm."""

FEWEST_FOR_TAIL = 200
"""Residuals below which a single one decides on the tail that it is tested with."""

MOST_GROSS = 0.5
"""Share of gross errors among the residuals up to `TAIL_REACH`, at most."""

# --- rejection

TESTED_REDUNDANCY = 0.01
"""Redundancy of a kind below which nothing tests it."""

SMALL_ROOM = 3
"""Records of the smallest kind that may be wrong, if its redundancy allows it."""

# --- reliability

DELTA0 = 4.13
"""Non-centrality of a test at the level 0.1 % with power 80 %."""

# --- significance

INSEPARABLE = 0.999
"""Correlation from which on two parameters cannot be told apart."""

UNDETERMINED_SHARE = 0.1
"""Share of the data in an estimated parameter below which its value is that of its prior."""

# --- variance components

SILENT_REDUNDANCY = 0.02
"""Records with a smaller mean redundancy number say nothing of their own variance."""

ESTIMABLE_REDUNDANCY = 10.0
"""Least redundancy of a group whose standard deviation is estimated."""


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
