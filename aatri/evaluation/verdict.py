"""One sentence or two on what is known of the accuracy, and from what. No figure without the points it comes from."""

from __future__ import annotations

from collections.abc import Mapping


def verdict(figures: Mapping[str, float], *, control_is_exact: bool, enough: int) -> str:
    """What is known of the accuracy.

    Parameters
    ----------
    figures : mapping
        As in Evaluation; what was not determined is missing.
    control_is_exact : bool
        All control coordinates have standard deviation 0.
    enough : int
        From how many check points on there is no reserve.
    """
    parts = [_check(figures, enough), _control(figures, control_is_exact), _truth(figures)]
    return " ".join(part for part in parts if part)


def _check(figures: Mapping[str, float], enough: int) -> str:
    n = int(figures.get("check_points", 0))
    if not n:
        return "No independent check: no check point is determined."
    text = f"Check: {_xyz(figures, 'check_rmse_{}_m')} m RMSE at {_count(n, 'check point')}"
    reserves = []
    if n < enough:
        reserves.append(f"fewer than {enough}, see the intervals")
    if outside := int(figures.get("check_outside_points", 0)):
        reserves.append(f"{outside} outside the control, extrapolated")
    return text + (f" ({'; '.join(reserves)})." if reserves else ".")


def _control(figures: Mapping[str, float], exact: bool) -> str:
    n = int(figures.get("control_points", 0))
    if not n:
        return "No control point is determined."
    nature = "given as exact" if exact else "not a measure of accuracy"
    text = f"Fit to {_count(n, 'control point')} ({nature}): {_xyz(figures, 'control_rmse_{}_m')} m RMS"
    rejected = int(figures.get("control_rejected_points", 0))
    return text + (f"; {rejected} rejected." if rejected else ".")


def _truth(figures: Mapping[str, float]) -> str:
    n = int(figures.get("truth_points", 0))
    if not n:
        return ""
    theory = ""
    if "theory_rmse_x_m" in figures:
        theory = f", {_xyz(figures, 'theory_rmse_{}_m')} m in theory"
    return f"Truth (simulated): {_xyz(figures, 'truth_rmse_{}_m')} m RMSE at {_count(n, 'new point')}{theory}."


def _xyz(figures: Mapping[str, float], name: str) -> str:
    values = ((axis.upper(), figures.get(name.format(axis))) for axis in "xyz")
    return ", ".join(f"{axis} {_metres(value)}" for axis, value in values if value is not None)


def _metres(value: float) -> str:
    return f"{value:.4f}" if value == 0 or value >= 0.0005 else f"{value:.1e}"


def _count(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"
