"""Leave-one-out over control: how far each control point would be off had the adjustment not seen it.

With l the given coordinates of a control point, C their covariance, x the adjusted ones and Q the covariance of those
(a priori), the residual v = x - l has the covariance C - Q, the redundancy matrix is R = (C - Q) C^-1, and the
adjustment without this point predicts it with the difference and covariance

    d = R^-1 v = C (C - Q)^-1 v,      C_d = R^-1 C = C (C - Q)^-1 C

exactly in the linear model; no adjustment is repeated. Only coordinates that are observed take part. A point without
redundancy (R singular: nothing else determines it) is predicted by nothing, and counted apart. Points whose errors are
correlated with others' and exact control are left out, and so is all control where the datum is free.

Source: Foerstner and Wrobel 2016, 4.6.2 (redundancy matrix); Cook and Weisberg 1982, 2.2 (predicted residuals).
"""

from dataclasses import dataclass

import numpy as np

from aatri.adjustment.statistics.reliability import UNCONTROLLED
from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.evaluation.differences import PointDifferences
from aatri.evaluation.statistics import bias, largest, rmse
from aatri.ids import rows_of


@dataclass(frozen=True)
class Predicted:
    """Control points as predicted without themselves."""

    differences: PointDifferences
    """Prediction minus given, and its standard deviation."""
    uncontrolled: Int
    """(n,) int32. Rows in points of those that nothing else determines."""


def leave_one_out(block: Block, solution: Solution, control: PointDifferences) -> Predicted:
    """Predict each control point without itself.

    Parameters
    ----------
    control : PointDifferences
        Solution minus given at control points in use.
    """
    covariance = _observed_covariances(block, solution, control)
    n = len(control.point)
    difference, sigma = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
    undetermined = np.zeros(n, dtype=bool)
    if solution.datum is None:
        for k in range(n):
            observed = np.flatnonzero(np.isfinite(control.difference_m[k]))
            prediction = _one(
                covariance[k], solution.points.covariance_m2[control.point[k]], control.difference_m[k], observed
            )
            if prediction is None:
                continue
            difference[k, observed], sigma[k, observed], undetermined[k] = prediction
    predicted = np.isfinite(difference).any(axis=1)
    return Predicted(PointDifferences(control.point, difference, sigma).take(predicted), control.point[undetermined])


def left_out_figures(predicted: Predicted) -> dict[str, float]:
    """Figures of control left out one by one; nothing where none is predicted."""
    d = predicted.differences
    if not len(d.point):
        return {}
    theory = rmse(d.sigma_m)
    ratio = np.divide(rmse(d.difference_m), theory, out=np.full(3, np.nan), where=np.nan_to_num(theory) > 0)
    counts = {"left_out_uncontrolled_points": float(len(predicted.uncontrolled))} if len(predicted.uncontrolled) else {}
    off = d.difference_m
    by_axis = {
        "rmse_{}_m": rmse(off),
        "bias_{}_m": bias(off),
        "max_{}_m": largest(off),
        "theory_rmse_{}_m": theory,
        "theory_ratio_{}": ratio,
    }
    figures = {
        f"left_out_{name.format(axis)}": float(value)
        for name, values in by_axis.items()
        for axis, value in zip("xyz", values)
    }
    return {"left_out_points": float(len(d.point)), **figures, **counts}


def _one(C: Float, Q: Float, v: Float, observed: Int) -> tuple[Float, Float, bool] | None:
    """Difference and standard deviation of the prediction; NaN where it is uncontrolled; None without covariances."""
    C, Q = C[np.ix_(observed, observed)], Q[np.ix_(observed, observed)]
    if not len(observed) or not np.isfinite(C).all() or not np.isfinite(Q).all() or (np.diag(C) <= 0).any():
        return None
    scale = np.sqrt(np.diag(C))
    correlation = C / np.outer(scale, scale)
    left = (C - Q) / np.outer(scale, scale)
    root = np.linalg.cholesky(correlation)
    R = np.linalg.solve(root, np.linalg.solve(root, left).T)
    least = float(np.linalg.eigvalsh(0.5 * (R + R.T)).min())
    if least < -1e-3:  # adjusted coordinates less certain than given ones: not from an adjustment that took them
        return None
    if least < UNCONTROLLED:
        unknown = np.full(len(observed), np.nan)
        return unknown, unknown, True
    gain = scale[:, None] * correlation @ np.linalg.inv(left)
    variance = np.diag(gain @ correlation) * scale
    return gain @ (v[observed] / scale), np.sqrt(variance), False


def _observed_covariances(block: Block, solution: Solution, control: PointDifferences) -> Float:
    """Covariances of the given coordinates as they took part, (n, 3, 3); NaN where they are correlated with others'."""
    ground, residuals = block.ground_points, solution.residuals
    row = {int(p): k for k, p in enumerate(ground.point)}
    covariance = ground.covariance_m2[[row[int(p)] for p in control.point]].copy().reshape(-1, 3, 3)
    rows = residuals.used("control")
    sigma = np.full((len(block.points), 3), np.nan)
    sigma[rows_of(residuals.point[rows], block.points.id)] = residuals.sigma[rows]
    nominal_sigma = np.sqrt(np.einsum("nii->ni", covariance))
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.where(nominal_sigma > 0, sigma[control.point] / nominal_sigma, np.nan)
    factor = np.where(np.isfinite(factor), factor, 1.0)
    covariance *= factor[:, :, None] * factor[:, None, :]
    covariance[_correlated(block)[control.point]] = np.nan
    return np.asarray(covariance)


def _correlated(block: Block) -> Bool:
    """Points that share a covariance with another."""
    of_point = np.zeros(len(block.points), dtype=bool)
    table = block.ground_point_covariances
    if len(table):
        of_point[block.ground_points.point[np.concatenate([table.row_a, table.row_b])]] = True
    return of_point
