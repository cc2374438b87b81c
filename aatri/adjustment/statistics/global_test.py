"""The global test of an adjustment: does sigma0 fit the standard deviations given?

    sigma0^2 = v'P v / r,   r sigma0^2 ~ chi2(r)   where model and standard deviations are right (sigma0 a priori 1)

sigma0 is therefore expected between sqrt(chi2(r; 0.025) / r) and sqrt(chi2(r; 0.975) / r). It stands beside this 95 %
interval always. A chain makes five such tests and more, and one in twenty fails where nothing is wrong: sigma0 does not
fit where it is outside the 99.9 % interval. With many observations the test is very sharp, and standard deviations are
seldom known to a few per cent: a warning takes more, outside that interval *and* beyond 0.8 to 1.25. Beyond 0.5 to 2
the standard deviations of the result say nothing; beyond `max_sigma0` there is no result.

Many small adjustments (images, models) are pooled: sum v'P v over sum r is tested once. A single one is listed where
chi2 exceeds its bound at the level 0.001 / count, so that a set in which nothing is wrong lists one in a thousand
times, and where its sigma0 is beyond 1.25.

Source: Koch, Parameter Estimation and Hypothesis Testing, 4.2; Bonferroni's bound for the single ones.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from aatri.adjustment.statistics.limits import ALARM, COARSEST_RAD, FAR_BEYOND, MAX_SIGMA0, SHOWN, WARNED_BEYOND
from aatri.arrays import Bool, Float, Int
from aatri.errors import ConvergenceError
from aatri.notes import Note

Verdict = Literal["untested", "fits", "outside", "warned", "far"]


@dataclass(frozen=True)
class GlobalTest:
    """sigma0 with its test."""

    sigma0: float
    """NaN without redundancy."""
    redundancy: int
    low: float
    high: float
    """Where sigma0 is expected with 95 %; NaN without redundancy."""
    verdict: Verdict
    """In the 99.9 % interval; outside, but within 0.8 to 1.25; beyond that; beyond 0.5 to 2."""


def global_test(sigma0: float, redundancy: int) -> GlobalTest:
    """Test sigma0 against 1.

    Parameters
    ----------
    sigma0 : float
        NaN counts as not determined.
    """
    if redundancy < 1 or not np.isfinite(sigma0):
        return GlobalTest(float("nan"), max(redundancy, 0), float("nan"), float("nan"), "untested")
    low, high = sigma0_interval(redundancy)
    least, most = sigma0_interval(redundancy, ALARM)
    verdict: Verdict = "outside"
    if least <= sigma0 <= most:
        verdict = "fits"
    elif not FAR_BEYOND[0] <= sigma0 <= FAR_BEYOND[1]:
        verdict = "far"
    elif not WARNED_BEYOND[0] <= sigma0 <= WARNED_BEYOND[1]:
        verdict = "warned"
    return GlobalTest(float(sigma0), int(redundancy), low, high, verdict)


def pooled_test(sigma0: Float, redundancy: Int) -> GlobalTest:
    """Test many small adjustments at once: sum v'P v over sum r.

    Parameters
    ----------
    sigma0 : (n,) float64
        NaN without redundancy.
    redundancy : (n,) int
    """
    testable = (redundancy > 0) & np.isfinite(sigma0)
    total = int(redundancy[testable].sum())
    squares = float((sigma0[testable] ** 2 * redundancy[testable]).sum())
    return global_test((squares / total) ** 0.5 if total else float("nan"), total)


def single_misfits(sigma0: Float, redundancy: Int) -> Bool:
    """Which of many small adjustments do not fit: at the level 0.001 / count, and sigma0 beyond 1.25.

    Parameters
    ----------
    sigma0 : (n,) float64
        NaN without redundancy.
    redundancy : (n,) int

    Returns
    -------
    (n,) bool
    """
    from scipy.special import chdtrc  # upper tail

    testable = (redundancy > 0) & np.isfinite(sigma0)
    level = ALARM / max(int(testable.sum()), 1)
    r, s = np.where(testable, redundancy, 1), np.where(testable, sigma0, 0.0)
    return np.asarray(testable & (chdtrc(r, r * s**2) < level) & (s > WARNED_BEYOND[1]))


def sigma0_interval(redundancy: int, outside: float = SHOWN) -> tuple[float, float]:
    """Two-sided interval of sigma0 where the model and the standard deviations are right.

    Parameters
    ----------
    redundancy : int
        1 or more.
    outside : float
        Probability outside the interval: of 95 % unless told.

    Returns
    -------
    low, high : float

    Examples
    --------
    >>> low, high = sigma0_interval(100)
    >>> round(low, 3), round(high, 3)
    (0.862, 1.138)
    """
    from scipy.special import chdtri  # inverse of the upper tail

    low, high = chdtri(redundancy, 1 - outside / 2), chdtri(redundancy, outside / 2)
    return float(low / redundancy) ** 0.5, float(high / redundancy) ** 0.5


def sigma0_note(test: GlobalTest, what: str = "") -> Note:
    """sigma0 with its interval, in words; a warning where it does not fit.

    Parameters
    ----------
    what : str
        What was adjusted, where it is not clear from the stage: `of 240 models`.
    """
    name = f"sigma0 {what}".rstrip()
    if test.verdict == "untested":
        return Note("note", f"{name} is not determined: no redundancy, nothing is checked")
    text = f"{name} {test.sigma0:.3f}, expected {test.low:.3f} to {test.high:.3f} (95 %, redundancy {test.redundancy})"
    if test.verdict == "fits":
        return Note("note", text)
    if test.verdict == "outside":
        return Note("note", f"{text}: outside, but near 1")
    cause = "gross errors, an effect not modelled, or standard deviations that are too small"
    if test.sigma0 < test.low:
        cause = "standard deviations that are too large"
    what_of_it = "the standard deviations of the result are wrong by as much"
    if test.verdict == "far":
        what_of_it = "far off, the standard deviations of the result say nothing"
    return Note("warning", f"{text}: {cause}; {what_of_it}")


def largest_sigma0(sigma_rad: float) -> float:
    """`MAX_SIGMA0`, or where directions with these standard deviations times it are still measured well, more.

    Examples
    --------
    >>> largest_sigma0(1e-4), round(largest_sigma0(1e-6))
    (20.0, 1000)
    """
    return max(MAX_SIGMA0, COARSEST_RAD / sigma_rad) if sigma_rad > 0 else MAX_SIGMA0


def refuse_misfit(test: GlobalTest, max_sigma0: float = MAX_SIGMA0, what: str = "") -> None:
    """Refuse a result whose sigma0 is beyond `max_sigma0`.

    Raises
    ------
    ConvergenceError
    """
    if test.verdict != "untested" and test.sigma0 > max_sigma0:
        name = f"sigma0 {what}".rstrip()
        raise ConvergenceError(
            f"{name} is {test.sigma0:.3g}, beyond max_sigma0 = {max_sigma0:g}: the adjustment ended where the "
            "observations do not fit it",
            remedy="check ids, units, camera, start values and control; look for gross errors with a robust method "
            "first; standard deviations that are too small by this factor are to be corrected in the block",
        )
