"""What orientations tell of the mounts of a rig: angles in another convention than declared.

    D = F' R_b M_0'      of every exposure: the turn of a member that its mount lacks, F the rotation of the rig's frame

Seen: a bundle with open unknowns, or far from any fit, as exact mounts and the images contradict each other.
Test: the D of a member are above `WRONG_ATTITUDES_RAD` in the median, and below it and `AGREEING_READING` of that in
another convention of `attitude_convention` (opposite signs, the transposed matrix, another unit). Free angles are start
values, and not tested.
"""

import numpy as np

from aatri.adjustment.unknowns import State
from aatri.arrays import Float, finite_rows
from aatri.artifacts.block import Block
from aatri.checks.at_start.attitude_convention import readings_of
from aatri.checks.finding import Finding
from aatri.checks.limits import AGREEING_READING, FEWEST_ATTITUDES, SAME_READING, WRONG_ATTITUDES_RAD
from aatri.geometry.rotations import log_rotation
from aatri.observations.poses import POSE
from aatri.observations.rigs import rig_pairs


def mount_conventions(block: Block, state: State) -> list[Finding]:
    """Errors of mounts of a block with rigs whose angles agree with the images in another convention."""
    members, findings = block.rig_members, list[Finding]()
    pairs, rotation = rig_pairs(block), state[POSE].ground_from_image
    frame = rotation[pairs.first] @ pairs.mount[pairs.first_mount].swapaxes(1, 2)
    relative = frame.swapaxes(1, 2) @ rotation[pairs.second]
    usable = finite_rows(relative) & members.is_frame[pairs.first_mount]
    for k in np.unique(pairs.second_mount[usable]).tolist():
        turns = relative[usable & (pairs.second_mount == k)]
        if len(turns) < FEWEST_ATTITUDES or members.angle_free[k].any():
            continue

        def lacking(mount: Float, turns: Float = turns) -> float:
            return float(np.median(np.linalg.norm(log_rotation(turns @ mount.T), axis=1)))

        as_declared = lacking(pairs.mount[k])
        if as_declared <= WRONG_ATTITUDES_RAD:
            continue
        readings = [(lacking(R[0]), what) for what, R in readings_of(members.angles_rad[k : k + 1])]
        least = min(readings)[0]
        best, what = next(reading for reading in readings if reading[0] <= SAME_READING * least)
        if best <= min(AGREEING_READING * as_declared, WRONG_ATTITUDES_RAD):
            text = f"its mount differs by {np.degrees(as_declared):.3g} deg from the orientations of its images"
            text += f"; read as {what} its angles agree to {np.degrees(best):.2g} deg"
            where = f"member {members.member[k]} of rig {members.rig[k]}"
            findings.append(Finding("mounts", "error", text, "correct its angles (rigs in block.yaml)", where=where))
    return findings
