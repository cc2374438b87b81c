"""Positions of images that cannot be are set aside by name; more of them than the share are an error.

Seen: a single record of zero tilts a block or switches off the others; a receiver without a fix repeats its last.
Test: with m the median of the positions, s 1.4826 times the median distance from it, H the height of m above control,

- a position lies off if it is farther from m in plan than 50 times the larger of s and H;
- its height is wrong if it is less than H / 10 above control, where the others agree to H / 5 (a higher one is legal).
  Around an object, whose control stands more than half as high as the images, and where several are so low, it is wrong
  if it is below all control;
- if all positions are the same, they say nothing of any image.

One may always go, however few there are, and all where all are the same.
"""

from dataclasses import replace

import numpy as np

from aatri.arrays import Float
from aatri.artifacts.block import Block
from aatri.checks.as_read.rejects import listed, rejected
from aatri.checks.finding import Finding
from aatri.checks.limits import FAR_POSITION, FEWEST_POSITIONS, LEVEL_FLIGHT, LOW_POSITION, SAME_POSITION_M
from aatri.ids import several
from aatri.observations.control import control_of
from aatri.units import length

THE_SAME = "position is that of all"
"""How the reason begins where all are the same."""

REMEDY = "mend these rows, or leave their coordinates empty; or allow more with max_reject_share"


def without_impossible_positions(block: Block, max_share: float) -> tuple[Block, list[Finding]]:
    """The block without these positions, listed in its rejects; or the error of too many.

    Parameters
    ----------
    max_share : float
        Largest share of the positions that may be set aside; one may always.
    """
    control, exterior = control_of(block), block.exterior
    heights: Float = control.xyz_m[control.given[:, 2], 2]
    reasons = impossible_positions(exterior.position_m, heights if len(heights) else np.array([block.terrain_height_m]))
    if not reasons:
        return block, []
    rows, reasons_of_rows = np.array(list(reasons)), list(reasons.values())
    names = block.images.id[exterior.image[rows]].tolist()
    total = int(np.isfinite(exterior.position_m).all(axis=1).sum())
    if len(rows) > max(1.0, max_share * total) and not reasons_of_rows[0].startswith(THE_SAME):
        places = [block.read_at(exterior, int(row)) for row in rows]
        text = f"{len(rows)} of {total} positions cannot be right; at most {max_share:.0%} may be set aside: "
        text += listed([f"{name}, {reason}" for name, reason in zip(names, reasons_of_rows)], places)
        return block, [Finding("positions", "error", text, REMEDY, where=places[0])]
    position, covariance = exterior.position_m.copy(), exterior.position_covariance_m2.copy()
    use, group = exterior.position_use.copy(), exterior.drift_group.copy()
    position[rows], covariance[rows], use[rows], group[rows] = np.nan, np.nan, 0, ""
    kept = replace(
        exterior, position_m=position, position_covariance_m2=covariance, position_use=use, drift_group=group
    )
    return replace(rejected(block, "exterior", exterior, rows.tolist(), names, reasons_of_rows), exterior=kept), []


def impossible_positions(position_m: Float, control_height_m: Float) -> dict[int, str]:
    """Rows of positions that cannot be right, with the reason.

    Parameters
    ----------
    position_m : (n, 3) float64, m
        NaN not known.
    control_height_m : (m,) float64, m
        Heights of the control points, or that of the terrain; NaN not known.
    """
    rows = np.flatnonzero(np.isfinite(position_m).all(axis=1))
    if len(rows) < FEWEST_POSITIONS:
        return {}
    xyz = position_m[rows]
    if (np.ptp(xyz, axis=0) <= SAME_POSITION_M).all():
        return {int(row): f"{THE_SAME} {several(len(rows), 'image')}" for row in rows}
    middle = np.median(xyz, axis=0)
    spread = 1.4826 * np.median(np.abs(xyz - middle), axis=0)
    ground_m = float(np.median(control_height_m))
    above = max(0.0, np.nan_to_num(float(middle[2]) - ground_m))
    off = np.linalg.norm(xyz[:, :2] - middle[:2], axis=1)
    reach = FAR_POSITION * max(float(np.hypot(*spread[:2])), above)
    reasons = {
        k: f"position lies {length(float(off[k]))} from the middle of the others"
        for k in np.flatnonzero((off > reach) & (reach > 0)).tolist()
    }
    if above > LEVEL_FLIGHT * spread[2]:
        is_around = control_height_m.max() > middle[2] - 0.5 * above
        low = xyz[:, 2] < ground_m + LOW_POSITION * above
        if is_around or low.sum() > 1:  # images around an object, or a lower flight
            low = xyz[:, 2] < control_height_m.min()
        for k in np.flatnonzero(low).tolist():
            reasons.setdefault(k, f"height of {xyz[k, 2]:.4g} m, that of the others is {middle[2]:.4g} m")
    return {int(rows[k]): reason for k, reason in sorted(reasons.items())}
