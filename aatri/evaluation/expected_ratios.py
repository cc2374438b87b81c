"""Where the ratio of empirical to theoretical accuracy lies if the theory is right.

Errors of neighbouring points are correlated: n of them amount to n_e = (tr C)^2 / tr C^2 independent ones, which the
adjustment counts (`adjustment.covariance.independent`). The square of the ratio is then about chi-square over its
degrees of freedom, n_e:

    sqrt(chi2(n_e, (1 - P) / 2) / n_e)  <  RMSE / theory  <  sqrt(chi2(n_e, (1 + P) / 2) / n_e)
"""

from collections.abc import Mapping

import numpy as np

from aatri.adjustment.statistics.limits import ALARM
from aatri.artifacts.solution import IndependentErrors

RATIOS = {
    "new": ("truth", "truth_over_theory"),
    "check": ("check", "check_theory_ratio"),
    "left_out": ("left_out", "left_out_theory_ratio"),
}


def expected_ratios(
    figures: Mapping[str, float], independent: IndependentErrors | None, confidence: float
) -> dict[str, float]:
    """Number of independent errors and limits of each ratio among the figures.

    Parameters
    ----------
    independent : IndependentErrors, optional
    confidence : float
        Probability within the limits.
    """
    ratios: dict[str, float] = {}
    for points, counts in zip(independent.points, independent.count) if independent is not None else ():
        what, ratio = RATIOS[str(points)]
        for axis, n in zip("xyz", counts.tolist()):
            if f"{ratio}_{axis}" in figures and np.isfinite(n):
                low, high = _limits(n, confidence)
                ratios |= {f"{what}_independent_{axis}": n, f"{ratio}_{axis}_low": low, f"{ratio}_{axis}_high": high}
    return ratios


def outside_expected(figures: Mapping[str, float], points: str) -> list[str]:
    """A sentence of the ratios that hardly come by chance, at `new` or `check` points, or of control `left_out`."""
    what, ratio = RATIOS[points]
    beyond = []
    for axis in "xyz":
        value, n = figures.get(f"{ratio}_{axis}", np.nan), figures.get(f"{what}_independent_{axis}", np.nan)
        if not np.isfinite(n):
            continue
        low, high = _limits(n, 1.0 - ALARM)
        if not low <= value <= high:
            chance = f"{low:.2f} to {high:.2f} by chance of {n:.0f} independent errors"
            beyond.append(f"{value:.2f} times their standard deviations in {axis.upper()} ({chance})")
    names = {
        "check": "Errors at check points",
        "new": "True errors",
        "left_out": "Errors of control predicted without itself",
    }
    return [f"{names[points]} are {', '.join(beyond)}."] if beyond else []


def _limits(n: float, confidence: float) -> tuple[float, float]:
    from scipy.special import chdtri  # inverse of the upper tail

    low, high = (chdtri(n, (1.0 + sign * confidence) / 2) for sign in (1.0, -1.0))
    return float(np.sqrt(low / n)), float(np.sqrt(high / n))
