"""Coordinates that do not lie in the frame that is declared for them.

Seen: another zone, axes exchanged, a map that is taken as Cartesian.
Test: coordinates lie outside of where their CRS is used; a block with `earth_curvature: ignore` in no tangent frame is
more than 10 km across, over which the earth bends by d^2 / 8R, 2 m.
"""

import numpy as np

from aatri.artifacts.block import Block
from aatri.checks.finding import Finding
from aatri.checks.limits import LARGE_BLOCK_M
from aatri.frames.checks import place_outside
from aatri.frames.conversion import Frame
from aatri.frames.heights import is_tangent_frame
from aatri.observations.control import control_of
from aatri.units import EARTH_RADIUS_M, length


def outside_of_its_frame(block: Block) -> list[Finding]:
    """Coordinates far from where their CRS is used, and large blocks whose frame is taken as Cartesian."""
    frames = block.frames
    crs = str(frames.crs[0]) if len(frames) else "local"
    if is_tangent_frame(crs):
        return []
    findings = []
    if crs != "local":
        control = control_of(block)
        frame = Frame(str(frames.id[0]), tuple(str(frames.axes[0]).split(",")), crs)
        xyz = np.vstack([control.xyz_m[control.given.all(axis=1)], block.exterior.position_m])
        if outside := place_outside(frame, xyz):
            remedy = "check its code, the order of the axes and a zone before the easting"
            findings.append(Finding("frame", "warning", outside, remedy))
    xy = np.concatenate([block.exterior.position_m[:, :2], block.ground_points.xyz_m[:, :2]])
    xy = xy[np.isfinite(xy).all(axis=1)]
    across = float(np.linalg.norm(np.ptp(xy, axis=0))) if len(xy) else 0.0
    if block.earth_curvature == "ignore" and across > LARGE_BLOCK_M:
        bend = length((across / 2) ** 2 / (2 * EARTH_RADIUS_M))
        text = f"the block is {length(across)} across, taken as Cartesian; in a map heights bend by {bend} to its ends"
        findings.append(Finding("frame", "warning", text, "if it is a map, declare crs and leave out earth_curvature"))
    return findings
