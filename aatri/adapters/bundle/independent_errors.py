"""How many independent errors new points, check points and control left out of a bundle have, axis by axis."""

from dataclasses import replace

import numpy as np

from aatri.adjustment.covariance.independent import independent_errors, independent_predictions
from aatri.adjustment.covariance.score import with_factor
from aatri.adjustment.records import whitened
from aatri.arrays import Float
from aatri.artifacts.block import CHECK, CONTROL, Block
from aatri.artifacts.solution import IndependentErrors
from aatri.observations.control import KIND as CONTROL_KIND
from aatri.observations.poses import POINT
from aatri.orientation.bundle.result import BundleResult

NEW_POINTS, CHECK_POINTS, LEFT_OUT = "new", "check", "left_out"

PREDICTED = 1e-6
"""Redundancy in every direction from which on the others predict a control point."""

MOST_POINTS, MOST_WITH_TESTS = 5_000, 200_000
"""Beyond this the errors are many and the count not worth its time, or, where observations are tested, its memory."""


def independent_errors_table(block: Block, result: BundleResult, *, tests: bool) -> IndependentErrors | None:
    """Counts of points that are no control, of check points, of control left out; None without their covariances.

    Held points have no errors, and are not counted. Whether a truth is known makes no difference: it changes nothing.

    Parameters
    ----------
    result : BundleResult
        In the frame of the adjustment.
    tests : bool
        Observations are tested too.
    """
    variance = np.einsum("nii->ni", result.covariances[POINT])
    determined = np.isfinite(variance) & (variance > 0) & np.isfinite(result.xyz_m)
    adjusted = result.adjusted
    most = MOST_WITH_TESTS if tests else MOST_POINTS
    if not determined.any() or len(determined) > most or result.free is not None or adjusted.down_weighted:
        return None
    result, none = replace(result, adjusted=with_factor(adjusted)), np.zeros_like(variance)
    adjusted = result.adjusted
    counts: dict[str, Float] = {}
    ground = block.ground_points
    new = determined.all(axis=1)
    new[ground.point[(ground.role == CONTROL).any(axis=1)]] = False
    if new.any():
        members = new[:, None] & np.ones(3, dtype=bool)
        counts[NEW_POINTS] = independent_errors(adjusted, POINT, members, variance, none)
    check = np.zeros_like(determined)
    check[ground.point] = ground.role == CHECK
    if check.any():
        variance_given = none.copy()
        variance_given[ground.point] = np.nan_to_num(np.einsum("nii->ni", ground.covariance_m2))
        counts[CHECK_POINTS] = independent_errors(adjusted, POINT, check & determined, variance, variance_given)
    if (left_out := _control_left_out(result)) is not None:
        counts[LEFT_OUT] = left_out
    if not counts:
        return None
    return IndependentErrors(points=np.array(list(counts)), count=np.array(list(counts.values())))


def _control_left_out(result: BundleResult) -> Float | None:
    """Of control points predicted each without itself, (3,); None where there is none that others predict."""
    adjusted = result.adjusted
    of_control = [o for o in result.observations if o.observed.kind == CONTROL_KIND and not o.observed.exact]
    control = next(
        (o for o in of_control if len(o.observed.records.touches) == 1 and o.observed.records.rows == 3), None
    )
    rows = np.flatnonzero(control.used) if control is not None else np.zeros(0, dtype=np.int64)
    if control is None or not len(rows) or not np.isfinite(control.covariance[rows]).all():
        return None
    records = control.observed.records
    block, observed = records.touches[0][1][rows], records.observed_components()[rows]
    _, (J,) = whitened(records, adjusted.state, rows)
    both = observed[:, :, None] & observed[:, None, :]
    R = np.where(both, np.eye(3) - control.covariance[rows], np.eye(3))
    predicted = np.linalg.eigvalsh(0.5 * (R + R.swapaxes(1, 2)))[:, 0] > PREDICTED
    whitener = records.whitener[rows]
    L = whitener[:, :, None] * np.eye(3) if whitener.ndim == 2 else whitener
    back = np.linalg.inv(np.where(both, L, np.eye(3)))
    gain = np.where(both & predicted[:, None, None], back @ np.linalg.pinv(R), 0.0)
    return independent_predictions(adjusted, POINT, block, J, gain)
