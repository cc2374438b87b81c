"""Weighted relative control that is so sharp that rounding hides what it touches.

Seen: points set aside as not determined, though many rays see them.
Test: a standard deviation of relative control below 1 / `SHARPER` of an image point's on the ground: weights differ by
its square, 4e8, and what rays say of the points of a plane or line comes near the rounding of its weights.
"""

import numpy as np

from aatri.arrays import Float
from aatri.artifacts.block import Block
from aatri.checks.finding import Finding
from aatri.checks.limits import SHARPER

ANGULAR = ("angle", "parallel", "perpendicular")
"""Types whose standard deviation is an angle."""


def sharp_conditions(block: Block, position_m: Float, xyz_m: Float) -> list[Finding]:
    """A warning for each condition that is better taken as exact.

    Parameters
    ----------
    position_m : (n_images, 3) float64, m
    xyz_m : (n_points, 3) float64, m
        Where the adjustment starts.
    """
    m, conditions = block.image_points, block.relative_control
    if not len(m):
        return []
    distance_m = np.linalg.norm(xyz_m[m.point] - position_m[m.image], axis=1)
    c_mm = block.cameras.principal_distance_mm[block.images.camera[m.image]]
    on_ground = m.sigma_mm.mean(axis=1) * distance_m / c_mm
    if not np.isfinite(on_ground).any():
        return []
    least_m = float(np.nanmedian(on_ground)) / SHARPER
    sharp = (conditions.sigma > 0) & (conditions.sigma < least_m) & ~np.isin(conditions.type, ANGULAR)
    return [
        Finding(
            "sharp_conditions",
            "warning",
            f"{conditions.type[k]}: a standard deviation of {conditions.sigma[k]:.2g} m is more than {SHARPER:,.0f} "
            "times as sharp as image points on the ground: rounding may hide what it touches",
            "check its unit, or write `exact: true`",
            where=block.read_at(conditions, int(k)),
        )
        for k in np.flatnonzero(sharp)
    ]
