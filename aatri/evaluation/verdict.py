"""A few sentences on what is known of the accuracy, and from what. No figure without the points it comes from.

It says, too, where the ratio of empirical to theoretical accuracy lies if the theory is right. Errors of neighbouring
points are correlated: n of them amount to n_e = (tr C)^2 / tr C^2 independent ones, which the adjustment counts
(`adjustment.covariance.independent`). The square of the ratio is then about chi-square over its degrees of freedom,
n_e:

    sqrt(chi2(n_e, (1 - P) / 2) / n_e)  <  RMSE / theory  <  sqrt(chi2(n_e, (1 + P) / 2) / n_e)
"""

from collections.abc import Mapping, Sequence

import numpy as np

from aatri.adjustment.statistics.global_test import GlobalTest
from aatri.adjustment.statistics.limits import ALARM
from aatri.artifacts.solution import IndependentErrors
from aatri.evaluation.limits import ENOUGH_CHECK_POINTS
from aatri.ids import shown
from aatri.units import rms_alike

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
            chance = f"chance gives {low:.2f} to {high:.2f} of {_count(round(n), 'independent error')}"
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


def verdict(
    figures: Mapping[str, float],
    *,
    control_is_exact: bool,
    enough: int,
    sigma0: GlobalTest | None = None,
    beyond: Sequence[str] = (),
) -> str:
    """What is known of the accuracy, a line for each statement.

    Parameters
    ----------
    figures : mapping
        As in Evaluation; what was not determined is missing.
    control_is_exact : bool
        All control coordinates have standard deviation 0.
    enough : int
        From how many check points on there is no reserve.
    sigma0 : GlobalTest, optional
        Of the adjustment: where it does not fit, theoretical standard deviations are as wrong.
    beyond : sequence of str
        Check points that no standard deviation explains.
    """
    far = f"Check points farther off than standard deviations and sigma0 explain: {shown(beyond)}." if beyond else ""
    fit = [_control(figures, control_is_exact), _left_out(figures)]
    outside = [text for points in RATIOS for text in outside_expected(figures, points)]
    parts = [_check(figures, enough), far, *fit, _truth(figures), *outside, _sigma0(sigma0)]
    return "\n".join(part for part in parts if part)


def _check(figures: Mapping[str, float], enough: int) -> str:
    n = int(figures.get("check_points", 0))
    if figures.get("check_aligned_components") == -1:
        return "No independent check: the datum is free, and the check points cannot carry what is open of it."
    if not n:
        return "No independent check: no check point is determined."
    text = f"Check: {_rms(figures, 'check_rmse', n)} RMSE at {_count(n, 'check point')}"
    reserves = [*_fitted(figures, "check")]
    if n < enough:
        reserves.append(f"fewer than {enough}, see the intervals; ASPRS edition 2 asks for {ENOUGH_CHECK_POINTS}")
    if outside := int(figures.get("check_outside_points", 0)):
        reserves.append(f"{outside} outside the control, extrapolated")
    return text + (f" ({'; '.join(reserves)})." if reserves else ".")


def _fitted(figures: Mapping[str, float], what: str) -> list[str]:
    n = int(figures.get(f"{what}_aligned_components", 0))
    return [f"datum free: fitted to them first in {n} of 7 components of a similarity"] if n > 0 else []


def _sigma0(test: GlobalTest | None) -> str:
    if test is None or test.verdict not in ("warned", "far"):
        return ""
    return (
        f"sigma0 is {test.sigma0:.2f}, expected {test.low:.2f} to {test.high:.2f}: the standard deviations "
        "of the result are wrong by as much."
    )


def _control(figures: Mapping[str, float], exact: bool) -> str:
    n = int(figures.get("control_points", 0))
    if not n:
        return "No control point takes part."
    nature = "given as exact" if exact else "not a measure of accuracy"
    text = f"Fit to {_count(n, 'control point')} ({nature}): {_rms(figures, 'control_rmse', n)} RMS"
    rejected = int(figures.get("control_rejected_points", 0))
    return text + (f"; {rejected} rejected." if rejected else ".")


def _left_out(figures: Mapping[str, float]) -> str:
    n = int(figures.get("left_out_points", 0))
    if not n:
        return ""
    uncontrolled = int(figures.get("left_out_uncontrolled_points", 0))
    more = f"; nothing else controls {_count(uncontrolled, 'control point')}" if uncontrolled else ""
    rms = _rms(figures, "left_out_rmse", n)
    return f"Control predicted without itself: {rms} RMSE at {_count(n, 'control point')}{more}."


def _truth(figures: Mapping[str, float]) -> str:
    n = int(figures.get("truth_points", 0))
    if figures.get("truth_aligned_components") == -1:
        return "Not compared with the truth: the datum is free, and too few points carry what is open of it."
    if not n:
        return ""
    theory = ""
    if "theory_rmse_x_m" in figures:
        theory = f", {_rms(figures, 'theory_rmse', n)} in theory"
    fitted = "".join(f" ({text})" for text in _fitted(figures, "truth"))
    return f"Truth (simulated): {_rms(figures, 'truth_rmse', n)} RMSE at {_count(n, 'new point')}{fitted}{theory}."


def _rms(figures: Mapping[str, float], name: str, n: int) -> str:
    values = {axis.upper(): figures[f"{name}_{axis}_m"] for axis in "xyz" if f"{name}_{axis}_m" in figures}
    texts, unit = rms_alike(values.values(), n)
    return f"{', '.join(f'{axis} {text}' for axis, text in zip(values, texts))} {unit}"


def _count(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"
