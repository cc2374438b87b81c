"""Lever arms that no carrier has: millimetres or centimetres where metres are asked for.

Seen: an absolute orientation whose scale runs away, a bundle whose sigma0 is far beyond its bound.
Test: positions of a camera refer to an antenna, and its lever arm is longer than the largest aircraft, or long and
longer than half the median distance from the positions of its images to the control that they show.
"""

import numpy as np

from aatri.arrays import Float, Int
from aatri.artifacts.block import ANTENNA, Block
from aatri.checks.finding import Finding
from aatri.checks.limits import LARGEST_AIRCRAFT_M, LEVER_SHARE, LONG_LEVER_ARM_M
from aatri.units import length


def impossible_lever_arms(block: Block, camera: Int, distance_m: Float) -> list[Finding]:
    """Errors of lever arms too long to be metres.

    Parameters
    ----------
    camera : (k,) int
        Of an image that shows control.
    distance_m : (k,) float64, m
        From its position to the control point.
    """
    exterior, findings = block.exterior, list[Finding]()
    armed = np.unique(block.images.camera[exterior.image[exterior.refers_to == ANTENNA]])
    for k in armed.tolist():
        size_m, away_m = float(np.linalg.norm(block.cameras.lever_arm_m[k])), distance_m[camera == k]
        text = f"a lever arm of {length(size_m)}"
        if size_m > LARGEST_AIRCRAFT_M:
            text += ", longer than any aircraft"
        elif size_m > LONG_LEVER_ARM_M and len(away_m) and size_m > LEVER_SHARE * float(np.median(away_m)):
            text += f", though the control it sees is {length(float(np.median(away_m)))} away"
        else:
            continue
        remedy = "give it in metres, along the axes of the camera (lever_arm in block.yaml)"
        findings.append(Finding("lever_arms", "error", text, remedy, where=f"camera {block.cameras.id[k]}"))
    return findings
