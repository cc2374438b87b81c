"""A bundle and the values it starts from: the checks of this room, in their order.

Seen: what the other files of this room look for.
Test: those of orientations and exchanged control only where the start comes from the block itself: an `initial` has
been checked by the stage that made it, and starts of a geocentric frame have no heights.
"""

from aatri.adapters.frame.adjustment_frame import points_out_of, poses_out_of
from aatri.checks.at_start.attitude_convention import attitude_conventions
from aatri.checks.at_start.conventions import other_conventions
from aatri.checks.at_start.exchanged_control import exchanged_control
from aatri.checks.at_start.frame import neglected_by_the_frame
from aatri.checks.at_start.mounts import mount_conventions
from aatri.checks.at_start.orientations import control_outside, unlikely_orientations
from aatri.checks.at_start.sharp_conditions import sharp_conditions
from aatri.checks.at_start.start_rays import start_rays
from aatri.checks.finding import Finding
from aatri.notes import Note
from aatri.observations.observed import ObservationSource
from aatri.orientation.bundle.block import BundleInput, start_of


def findings_at_start(source: ObservationSource, inputs: BundleInput, *, of_the_block: bool) -> list[Finding | Note]:
    """What there is to say before a bundle: of its frame, of conventions, and of the orientations it starts from.

    Parameters
    ----------
    source : ObservationSource
        What the observations of the block were taken from.
    of_the_block : bool
        The start comes from the block itself, not from an earlier stage.
    """
    block, frame = source.block, source.frame
    poses = poses_out_of(frame, inputs.poses.shifted(inputs.origin_m))
    xyz = points_out_of(frame, inputs.xyz_m + inputs.origin_m)
    findings: list[Finding | Note] = [
        *other_conventions(block, inputs),
        *neglected_by_the_frame(block, frame, poses.position_m, xyz),
    ]
    if len(block.relative_control):
        position_m = inputs.poses.shifted(inputs.origin_m).position_m
        findings += sharp_conditions(block, position_m, inputs.xyz_m + inputs.origin_m)
    if not of_the_block:  # attitudes held against orientations that others have made
        state = start_of(inputs)
        mounts = mount_conventions(block, state) if len(block.rig_members) else []
        return [*findings, *attitude_conventions(source, inputs, state, before=True), *mounts]
    if inputs.rays is None or (frame is not None and frame.geocentric):
        return findings
    return [
        *findings,
        *start_rays(block, inputs.rays, poses),
        *unlikely_orientations(block, poses.position_m, poses.ground_from_image, xyz),
        *control_outside(block, poses.position_m, poses.ground_from_image),
        *exchanged_control(source, inputs),
    ]
