"""Points with so few rays that a wrong one cannot be told from the others.

Seen: nothing: a point of two rays whose wrong ray is left out with the right one, or moves along its base; a point of
three of which two are wrong by errors that agree.
Test: a count. With the images held a point of n rays has 2n - 3 redundant observations. One is too little to say which
of two rays is wrong; with three, one wrong ray is told, but two wrong ones that intersect blame the third.
"""

import numpy as np

from aatri.checks.finding import Finding
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.result import BundleResult


def points_of_few_rays(result: BundleResult) -> list[Finding]:
    """How many points have two rays and three, and nothing else that is observed of them."""
    rays, others = (np.zeros(len(result.xyz_m), dtype=np.int64) for _ in range(2))
    for o in result.observations:
        touches = o.observed.records.touches
        groups = {group for group, _ in touches}
        for block in (block[o.used] for group, block in touches if group == POINT):
            count = np.bincount(block, minlength=len(rays))
            if POSE in groups:
                rays += count
            else:
                others += count
    adjusted = result.point_adjusted & (others == 0)
    two, three = (int((adjusted & (rays == n)).sum()) for n in (2, 3))
    if not two + three:
        return []
    text = f"of {int(result.point_adjusted.sum())} points {two} have two rays, of which nothing tells a wrong one apart"
    text += f", {three} have three, where two wrong ones that agree would blame the third"
    return [Finding("few_rays", "note", text, statistic=float(two + three))]
