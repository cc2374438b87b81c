"""The frame an adjustment is made in, and what it neglects of the earth.

Seen: heights that bend, positions that do not fit control by the scale of a map, a slope of the geoid that is missing.
Test: none: the effect is computed; above 0.1 mm it is told, above 1 mm it is a warning.
"""

import numpy as np

from aatri.adapters.frame.adjustment_frame import declared_frame
from aatri.arrays import Float, finite_rows
from aatri.artifacts.block import Block
from aatri.checks.finding import Finding, Level
from aatri.checks.limits import FRAME_EFFECT_TOLD_M, FRAME_EFFECT_WARNED_M, GEOID_SLOPE
from aatri.errors import AatriError
from aatri.frames.heights import is_tangent_frame
from aatri.frames.tangent import TangentFrame, tangent_frame
from aatri.units import EARTH_RADIUS_M


def neglected_by_the_frame(block: Block, frame: TangentFrame | None, position_m: Float, xyz_m: Float) -> list[Finding]:
    """What the frame of the adjustment is, or what adjusting in the block's own frame neglects.

    Parameters
    ----------
    position_m, xyz_m : (n, 3) float64, m
        Projection centres and points in the frame of the block.
    """
    centres, points = position_m[finite_rows(position_m)], xyz_m[finite_rows(xyz_m)]
    height = float(np.median(centres[:, 2]) - np.median(points[:, 2])) if len(centres) and len(points) else 0.0
    if frame is not None:
        return _of_tangent_frame(block, frame, points, height)
    crs = str(block.frames.crs[0])
    if not len(points) or is_tangent_frame(crs):
        return []
    half = 0.5 * float(np.linalg.norm(np.ptp(points[:, :2], axis=0)))
    bend = half**2 / (2 * EARTH_RADIUS_M)
    if crs != "local":
        return _of_map(block, points.mean(axis=0), height, bend)
    if bend < FRAME_EFFECT_TOLD_M or block.earth_curvature != "ignore":
        return []
    text = f"frame {block.frames.id[0]} is local and taken for Cartesian; in a map the earth bends it by {bend:.3g} m"
    return [Finding("frame", "note", text, "name the crs if its coordinates come from a map", statistic=bend)]


def _of_tangent_frame(block: Block, frame: TangentFrame, points: Float, height_m: float) -> list[Finding]:
    where = frame.to_block(np.zeros((1, 3)))[0]
    text = f"adjusted in the tangent frame of {block.frames.crs[0]} at {where[0]:.0f}, {where[1]:.0f}; results are in "
    findings = [Finding("frame", "note", f"{text}frame {block.frames.id[0]}")]
    vertical = str(block.frames.vertical[0])
    if frame.undulation_m:
        extent = float(np.linalg.norm(np.ptp(points[:, :2], axis=0))) if len(points) else 0.0
        text = (
            f"undulation {frame.undulation_m:g} m stands for the geoid grid of {vertical or 'the heights'}: its "
            f"slope, at worst {GEOID_SLOPE * extent:.2g} m of height over the block and "
            f"{GEOID_SLOPE * abs(height_m):.2g} m in plan up to the images, is neglected"
        )
        findings.append(Finding("frame", "note", text))
    elif np.isfinite(block.undulation_m) and vertical and block.undulation_m != 0:
        findings.append(Finding("frame", "warning", f"undulation is not used: the geoid grid of {vertical} is there"))
    return findings


def _of_map(block: Block, middle: Float, height_m: float, bend_m: float) -> list[Finding]:
    """The map's scale and curvature that an adjustment in map coordinates leaves in its heights."""
    try:
        source, undulation_m = declared_frame(block)
        D = tangent_frame(source, middle, undulation_m).derivatives_at(np.zeros((1, 3)))[0]
    except AatriError:
        return []
    if "x" in source.axes:
        return []
    scale = float(np.sqrt(abs(np.linalg.det(D[:2, :2]))))
    effect = abs(1.0 - scale) * abs(height_m)
    curved = "" if block.earth_curvature == "correct" else f", its ends by {bend_m:.3g} m for the earth's curvature"
    text = (
        f"adjusted in the map {block.frames.crs[0]} of scale {scale:.6f}: with observed positions, heights are "
        f"wrong by up to {effect:.3f} m{curved}"
    )
    size = max(effect, 0.0 if block.earth_curvature == "correct" else bend_m)
    if size <= FRAME_EFFECT_TOLD_M:
        return []
    level: Level = "warning" if size > FRAME_EFFECT_WARNED_M else "note"
    return [Finding("frame", level, text, "earth_curvature: frame has neither", statistic=size)]
