"""Points whose rays bound their distance by noise alone.

Seen: nothing: rays that are parallel but for noise intersect anywhere, at the distance and with the covariance that the
noise gives them, and fit.
Test: that of the inverse of their distance against 0 (`orientation.bundle.result.distance_tests`). Below the limit at
0.1 % (one-sided) the point may as well be at infinity: one that is there is named but once in a thousand times.
"""

import numpy as np

from aatri.adjustment.statistics.limits import ALARM
from aatri.checks.finding import Finding
from aatri.observations.poses import POINT
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.result import AT_INFINITY, BundleResult, distance_tests

REMEDY = "leave them out of use as ground points, or measure them in images farther apart"


def points_at_infinity(inputs: BundleInput, result: BundleResult) -> list[Finding]:
    """A warning of the points that may as well be at infinity."""
    if inputs.rays is None or POINT not in result.covariances:
        return []
    distance_m, test = distance_tests(result, inputs.rays)
    rows = np.flatnonzero(test < AT_INFINITY)
    if not len(rows):
        return []
    rows = rows[np.argsort(test[rows])]
    ids = tuple(f"{inputs.point_ids[k]} ({distance_m[k] / 1e3:.3g} km)" for k in rows.tolist())
    text = (
        "may as well be at infinity, their rays are parallel within their standard deviations and their coordinates "
        f"what noise makes of them: {len(rows)} of {int(result.point_adjusted.sum())} points"
    )
    return [Finding("at_infinity", "warning", text, REMEDY, ids=ids, statistic=float(test.min()), significance=ALARM)]
