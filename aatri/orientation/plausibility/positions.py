"""Positions of images that cannot be: far from all others, at the height of nothing, or all the same.

With m the median of the positions and s = 1.4826 times the median distance from it:

- a position lies off if it is farther from m in plan than 50 times the larger of s and the flying height H;
- its height is wrong if it is on the ground or below it, less than H / 10 above control, where the others fly at the
  height H above control, all within H / 5 (one higher image is legal);
- if all positions are the same, they say nothing of any image (receivers repeat the last fix).

Cf. the rows 56, 80, 81 of common input errors: one record of zero must neither tilt a block nor switch off the others.
"""

from __future__ import annotations

import numpy as np

from aatri.arrays import Float
from aatri.orientation.plausibility.control import length

FAR, LOW, LEVEL = 50.0, 0.1, 5.0
SAME_M = 1e-6
THE_SAME = "position is that of all"
"""How the reason begins where all are the same."""

FEWEST = 4
"""Fewer positions have no middle to be far from."""


def impossible_positions(position_m: Float, control_height_m: float) -> dict[int, str]:
    """Rows of positions that cannot be right, with the reason.

    Parameters
    ----------
    position_m : (n, 3) float64, m
        NaN not known.
    control_height_m : float
        Median height of the control points; NaN not known.

    Returns
    -------
    dict of int to str
    """
    known = np.flatnonzero(np.isfinite(position_m).all(axis=1))
    if len(known) < FEWEST:
        return {}
    xyz = position_m[known]
    found: dict[int, str] = {}
    if (np.ptp(xyz, axis=0) <= SAME_M).all():
        return {int(row): f"{THE_SAME} {len(known)} images" for row in known}
    middle = np.median(xyz, axis=0)
    spread = 1.4826 * np.median(np.abs(xyz - middle), axis=0)
    height = float(middle[2]) - control_height_m
    above = height if np.isfinite(height) and height > 0 else 0.0
    off = np.linalg.norm(xyz[:, :2] - middle[:2], axis=1)
    reach = FAR * max(float(np.hypot(*spread[:2])), above)
    for k in np.flatnonzero((off > reach) & (reach > 0)).tolist():
        found[k] = f"position lies {length(float(off[k]))} from the middle of the others"
    if above > LEVEL * spread[2]:
        for k in np.flatnonzero(xyz[:, 2] - control_height_m < LOW * above).tolist():
            found.setdefault(k, f"height of {xyz[k, 2]:.4g} m, that of the others is {middle[2]:.4g} m")
    return {int(known[k]): why for k, why in sorted(found.items())}
