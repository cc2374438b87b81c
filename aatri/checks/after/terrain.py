"""Ground points that lie off the terrain around them.

Seen: a gross error along the base of two rays, which only moves their point, mostly in height: no test of rays sees it.
Test: `orientation.bundle.terrain_test`, at 0.1 % for all points together.
"""

import numpy as np

from aatri.adjustment.statistics.limits import ALARM
from aatri.checks.finding import Finding
from aatri.ids import several
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.result import BundleResult
from aatri.orientation.bundle.terrain_test import off_terrain


def points_off_the_terrain(inputs: BundleInput, result: BundleResult) -> list[Finding]:
    """A warning of the points that lie off the terrain around them."""
    if inputs.rays is None or not (result.image_adjusted.any() and result.point_adjusted.any()):
        return []
    rays = np.bincount(inputs.rays.point[result.ray_used], minlength=len(inputs.point_ids))
    for rows in result.observations:  # what is tied to other points is no matter of the terrain: of spheres, facades
        touches = rows.observed.records.touches
        for group, block in touches if len(touches) > 1 and POSE not in dict(touches) else ():
            rays[block[rows.used] if group == POINT else []] = 0
    xyz = np.where(result.point_adjusted[:, None], result.xyz_m, np.nan)
    height = float(np.nanmedian(result.poses.position_m[:, 2]) - np.nanmedian(xyz[:, 2]))
    variance = np.maximum(np.nan_to_num(result.point_covariance_m2[:, 2, 2]), 0.0)
    downwards = float(np.median(result.poses.ground_from_image[result.image_adjusted, 2, 2]))
    off = off_terrain(xyz, np.sqrt(variance), rays, height, downwards)
    if not len(off.row):
        return []
    order = np.argsort(-off.test)
    ids = tuple(f"{inputs.point_ids[off.row[k]]} ({off.height_m[k]:+.3g} m)" for k in order.tolist())
    lie = several(len(ids), "point", "lies", "lie")
    text = f"doubtful: {lie} off the surrounding terrain by more than {off.limit:.3g} times its roughness"
    remedy = "measure it in a third image, or leave it out"
    test = float(off.test.max())
    return [Finding("terrain", "warning", text, remedy, ids=ids, statistic=test, significance=ALARM)]
