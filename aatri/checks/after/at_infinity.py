"""Points whose rays bound their distance by noise alone.

Seen: nothing: rays that are parallel but for noise intersect anywhere, at the distance and with the covariance that the
noise gives them, and fit.
Test: t = D / sqrt(u'C u), D the distance of the point from the middle of its images, u the direction, C its covariance.
It is that of 1 / D against 0, whose error is normal where that of D is not. Below the limit at 0.1 % (one-sided) the
point may as well be at infinity: one that is there is named but once in a thousand times.
Source: Civera, Davison and Montiel 2008, Inverse depth parametrization for monocular SLAM.
"""

import numpy as np
from scipy.special import ndtri

from aatri.adjustment.statistics.limits import ALARM
from aatri.arrays import Float
from aatri.checks.finding import Finding
from aatri.observations.poses import POINT
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.result import BundleResult

LIMIT = float(-ndtri(ALARM))

REMEDY = "leave them out of use as ground points, or measure them in images farther apart"


def points_at_infinity(inputs: BundleInput, result: BundleResult) -> list[Finding]:
    """A warning of the points that may as well be at infinity."""
    if inputs.rays is None or POINT not in result.covariances:
        return []
    away_m = result.xyz_m - _middle_of_images(inputs, result)
    distance_m = np.linalg.norm(away_m, axis=1)
    along = np.einsum("ni,nij,nj->n", away_m, result.point_covariance_m2, away_m) / distance_m**2
    test = distance_m / np.sqrt(np.where(result.point_adjusted & (along > 0), along, np.nan))
    rows = np.flatnonzero(test < LIMIT)
    if not len(rows):
        return []
    rows = rows[np.argsort(test[rows])]
    ids = tuple(f"{inputs.point_ids[k]} ({distance_m[k] / 1e3:.3g} km)" for k in rows.tolist())
    text = (
        "may as well be at infinity, their rays are parallel within their standard deviations and their coordinates "
        f"what noise makes of them: {len(rows)} of {int(result.point_adjusted.sum())} points"
    )
    return [Finding("at_infinity", "warning", text, REMEDY, ids=ids, statistic=float(test.min()), significance=ALARM)]


def _middle_of_images(inputs: BundleInput, result: BundleResult) -> Float:
    """Mean position of the images that see each point, (n_points, 3), m; NaN where none does."""
    assert inputs.rays is not None
    used = np.flatnonzero(result.ray_used)
    point, image = inputs.rays.point[used], inputs.rays.image[used]
    total, count = np.zeros((len(result.xyz_m), 3)), np.bincount(point, minlength=len(result.xyz_m))
    np.add.at(total, point, result.poses.position_m[image])
    return total / np.where(count > 0, count, np.nan)[:, None]
