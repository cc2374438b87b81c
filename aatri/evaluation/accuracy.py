"""Accuracy of a Solution: empirical at check points and against truth, theoretical from its covariances.

Three things are kept apart and never merged into one "accuracy":

- control: solution minus given at points the adjustment was fitted to. It tells how well the fit went; left out one by
  one, how well the others predict each (`leave_one_out`);
- check: solution minus given at points it never saw, the only independent measure of a real block;
- truth: solution minus truth at new points of a simulated block, beside the theoretical standard deviation
  m_i = sqrt(Q_ii) (a priori, sigma0 = 1). Both RMS are over the same points, and their ratio should be near 1.

A solution with a free datum is first fitted to what it is compared with, within what is open (`alignment`); that is
said, and where the fit is not over what carries the datum, errors are not divided by theoretical standard deviations.

The bias (mean) is given apart from the RMSE. The normalised squared error d' C^-1 d / 3, averaged over the points,
tests whole covariances: its expectation is 1. Definitions of all figures: docs/methods/accuracy.md.
Sources: ASPRS Positional Accuracy Standards, Edition 2 (30 check points); Foerstner and Wrobel 2016, 4.6.8.
"""

import numpy as np

from aatri.adjustment.statistics.global_test import global_test
from aatri.adjustment.statistics.limits import LEAST_LIMIT
from aatri.arrays import Bool, Float
from aatri.artifacts.block import CHECK, CONTROL, Block
from aatri.artifacts.evaluation import Differences, Evaluation, Figures
from aatri.artifacts.solution import Solution
from aatri.evaluation.alignment import Alignment, aligned, aligned_to_check
from aatri.evaluation.differences import (
    NO_DIFFERENCES,
    PointDifferences,
    check_differences,
    control_differences,
    is_new,
    rejected_control,
    truth_differences,
)
from aatri.evaluation.leave_one_out import leave_one_out, left_out_figures
from aatri.evaluation.limits import ENOUGH_CHECK_POINTS
from aatri.evaluation.orientations import by_axis, observed_position_figures, true_orientation_figures
from aatri.evaluation.statistics import bias, counts, largest, outside_hull, rmse, rmse_interval
from aatri.evaluation.verdict import expected_ratios, verdict
from aatri.units import together


def evaluate(
    block: Block, solution: Solution, *, confidence: float = 0.95, enough: int = ENOUGH_CHECK_POINTS
) -> Evaluation:
    """Figures and differences of a Solution.

    Parameters
    ----------
    block : Block
        With control and check points, and the truth if it is simulated.
    confidence : float
        Probability of the chi-square intervals.
    enough : int
        From how many check points on the check figures are taken without reserve.
    """
    at_check, at_truth = aligned_to_check(block, solution), _aligned_to_truth(block, solution)
    control = control_differences(block, solution)
    check = check_differences(block, at_check.solution) if at_check else NO_DIFFERENCES
    truth = truth_differences(block, at_truth.solution) if at_truth else NO_DIFFERENCES
    rejected = np.isin(control.point, rejected_control(block, solution))
    left_out = leave_one_out(block, solution, control.take(~rejected))
    rows = block.ground_points.point[block.ground_points.given_as(CONTROL)]
    plan = solution.points.xyz_m[:, :2]
    figures = {
        **_control_figures(control.take(~rejected), int(rejected.sum())),
        **left_out_figures(left_out),
        **_check_figures(check, outside_hull(plan[check.point], plan[rows]), confidence),
        **_truth_figures(truth, solution, _theory_points(block, solution, truth)),
        **(observed_position_figures(block, solution) if _positions_count(solution) else {}),
        **(true_orientation_figures(block, at_truth.solution) if at_truth else {}),
        **_datum_figures(block, solution, at_check, at_truth),
    }
    theories = (("check_theory", at_check), ("truth_over", at_truth), ("truth_nees", at_truth))
    without_theory = {name for name, theory in theories if theory is None or not theory.over_datum}
    determined = {
        name: value
        for name, value in figures.items()
        if not np.isnan(value) and not name.startswith(tuple(without_theory))
    }
    determined |= expected_ratios(determined, solution.independent_errors, confidence)
    over_datum = at_check is not None and at_check.over_datum
    parts = {"control": control, "left_out": left_out.differences, "check": check, "truth": truth}
    role = block.ground_points.role == CONTROL
    variance = np.einsum("nii->ni", block.ground_points.covariance_m2)
    return Evaluation(
        verdict=verdict(
            determined,
            control_is_exact=bool(role.any() and (variance[role] == 0).all()),
            enough=enough,
            sigma0=global_test(solution.remaining_sigma0, solution.counted_redundancy),
            beyond=beyond_every_bound(block, check, solution.remaining_sigma0) if over_datum else (),
        ),
        figures=Figures(name=np.array(list(determined)), value=np.array(list(determined.values()), dtype=np.float64)),
        differences=_table(block, solution, parts),
    )


def beyond_every_bound(block: Block, check: PointDifferences, sigma0: float) -> tuple[str, ...]:
    """Check points whose difference no standard deviation explains, also not one larger by sigma0: id, axis, size."""
    sigma = check.sigma_m * max(1.0, sigma0 if np.isfinite(sigma0) else 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(sigma > 0, np.abs(check.difference_m) / sigma, 0.0)
    worst = ratio.argmax(axis=1) if len(ratio) else np.zeros(0, dtype=int)
    rows = np.flatnonzero(ratio.max(axis=1, initial=0.0) > LEAST_LIMIT)
    return tuple(
        f"{block.points.id[check.point[k]]} ({together([check.difference_m[k, worst[k]]])} in {'XYZ'[worst[k]]}, "
        f"{ratio[k, worst[k]]:.1f} sigma)"
        for k in rows[np.argsort(-ratio.max(axis=1, initial=0.0)[rows], kind="stable")]
    )


def _aligned_to_truth(block: Block, solution: Solution) -> Alignment | None:
    if block.true_points is None:
        return Alignment(solution, 0, True)
    return aligned(block, solution, block.true_points.point, block.true_points.xyz_m)


def _positions_count(solution: Solution) -> bool:
    """Whether a comparison with observed positions says anything: the datum is given, or rests on them too."""
    return solution.datum is None or len(solution.residuals.used("position")) > 0


def _datum_figures(
    block: Block, solution: Solution, at_check: Alignment | None, at_truth: Alignment | None
) -> dict[str, float]:
    """How many components of the datum were fitted before comparing; -1 where they could not be."""
    if solution.datum is None:
        return {}
    asked = {
        "check_aligned_components": (at_check, bool((block.ground_points.role == CHECK).any())),
        "truth_aligned_components": (at_truth, block.true_points is not None),
    }
    return {name: float(ratio.components if ratio else -1) for name, (ratio, is_asked) in asked.items() if is_asked}


def _control_figures(control: PointDifferences, rejected: int) -> dict[str, float]:
    return {
        "control_points": len(control.point),
        **({"control_rejected_points": rejected} if rejected else {}),
        **by_axis("control_rmse_{}_m", rmse(control.difference_m)),
        **by_axis("control_bias_{}_m", bias(control.difference_m)),
        **by_axis("control_max_{}_m", largest(control.difference_m)),
    }


def _check_figures(check: PointDifferences, outside: Bool | None, confidence: float) -> dict[str, float]:
    root = rmse(check.difference_m)
    low, high = rmse_interval(root, counts(check.difference_m), confidence)
    figures = {
        "check_points": float(len(check.point)),
        **by_axis("check_rmse_{}_m", root),
        **by_axis("check_rmse_{}_low_m", low),
        **by_axis("check_rmse_{}_high_m", high),
        **by_axis("check_bias_{}_m", bias(check.difference_m)),
        **by_axis("check_max_{}_m", largest(check.difference_m)),
        **by_axis("check_theory_rmse_{}_m", rmse(check.sigma_m)),
        **by_axis("check_theory_ratio_{}", _ratio(check, rmse(check.sigma_m))),
    }
    if outside is not None and outside.any():
        figures |= {
            "check_outside_points": float(outside.sum()),
            **by_axis("check_inside_rmse_{}_m", rmse(check.difference_m[~outside])),
            **by_axis("check_outside_rmse_{}_m", rmse(check.difference_m[outside])),
        }
    return figures


def _truth_figures(truth: PointDifferences, solution: Solution, theory_m: Float) -> dict[str, float]:
    theory = rmse(theory_m)
    figures = by_axis("theory_rmse_{}_m", theory)
    if not len(truth.point):
        return figures
    root = rmse(truth.difference_m)
    return {
        "truth_points": float(len(truth.point)),
        **by_axis("truth_rmse_{}_m", root),
        **by_axis("truth_bias_{}_m", bias(truth.difference_m)),
        **by_axis("truth_max_{}_m", largest(truth.difference_m)),
        **figures,
        **by_axis("truth_over_theory_{}", _ratio(truth, theory)),
        "truth_nees": _nees(truth.difference_m, solution.points.covariance_m2[truth.point]),
    }


def _theory_points(block: Block, solution: Solution, truth: PointDifferences) -> Float:
    """Theoretical standard deviations over the new points; with truth, over the points the truth figures have."""
    if len(truth.point):
        return truth.sigma_m
    new = is_new(block) & np.isfinite(solution.points.xyz_m).any(axis=1)  # in a network some have no Z, or Z alone
    return np.asarray(np.sqrt(np.einsum("nii->ni", solution.points.covariance_m2[new])))


def _ratio(truth: PointDifferences, theory: Float) -> Float:
    """Empirical over theoretical, over the points that have both."""
    both = np.where(np.isfinite(truth.sigma_m), truth.difference_m, np.nan)
    return np.asarray(np.divide(rmse(both), theory, out=np.full(3, np.nan), where=np.nan_to_num(theory) > 0))


def _nees(difference: Float, covariance: Float) -> float:
    determined = np.asarray(np.isfinite(covariance).all(axis=(1, 2)))
    determined = np.asarray(determined & (np.linalg.det(np.where(determined[:, None, None], covariance, 0.0)) > 0))
    if not determined.any():
        return float("nan")
    d = difference[determined]
    return float(np.einsum("ni,ni->n", d, np.linalg.solve(covariance[determined], d[:, :, None])[..., 0]).mean() / 3)


def _table(block: Block, solution: Solution, parts: dict[str, PointDifferences]) -> Differences:
    rows = np.concatenate([part.point for part in parts.values()])
    return Differences(
        point=block.points.id[rows],
        kind=np.repeat(np.array(list(parts)), [len(part.point) for part in parts.values()]),
        difference_m=np.concatenate([part.difference_m for part in parts.values()]),
        sigma_m=np.concatenate([part.sigma_m for part in parts.values()]),
        rays=solution.points.rays[rows],
    )
