"""What orientations tell of the mounts of a rig: angles in another convention than declared.

    D = F' R_b M_0'      of every exposure: the turn of a member that its mount lacks, F the rotation of the rig's frame

Seen: a bundle with open unknowns, or far from any fit, as exact mounts and the images contradict each other.
Test: the D of a member, less `UNLIKELY_SIGMAS` of its angles, are above `WRONG_ATTITUDES_RAD` in the median, and below
it in the reading in which they agree (`angle_readings`). Free angles are start values, and not tested.
"""

import numpy as np

from aatri.adjustment.unknowns import State
from aatri.arrays import Float, finite_rows
from aatri.artifacts.block import Block
from aatri.checks.at_start.angle_readings import agreeing_reading, unlikely_turns
from aatri.checks.finding import Finding
from aatri.checks.limits import FEWEST_ATTITUDES, WRONG_ATTITUDES_RAD
from aatri.geometry.rotations import angles_from_rotation, log_rotation
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

        def disagreement(mount: Float, turns: Float = turns) -> float:
            return float(np.median(np.linalg.norm(log_rotation(turns @ mount[0].T), axis=1)))

        declared = pairs.mount[k : k + 1]
        about_axes = np.median(np.abs(log_rotation(turns @ declared[0].T)), axis=0)
        if unlikely_turns(about_axes, members.angle_sigma_rad[k]) <= WRONG_ATTITUDES_RAD:
            continue
        reading = agreeing_reading(members.angles_rad[k : k + 1], declared, disagreement)
        if reading is not None and disagreement(reading[1]) <= WRONG_ATTITUDES_RAD:
            what, mount = reading
            text = f"its mount differs by {np.degrees(disagreement(declared)):.3g} deg from the orientations of its "
            text += f"images; read as {what} its angles agree to {np.degrees(disagreement(mount)):.2g} deg"
            angles = ", ".join(f"{angle:.9g}" for angle in np.degrees(angles_from_rotation(mount)[0]).round(6) + 0.0)
            remedy = f"declare these as omega, phi, kappa of {angles} deg (rigs in block.yaml)"
            where = f"member {members.member[k]} of rig {members.rig[k]}"
            findings.append(Finding("mounts", "error", text, remedy, where=where))
    return findings
