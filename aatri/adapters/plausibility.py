"""Sanity of a block from its tables: control against positions as given; with orientations, cameras and control."""

from __future__ import annotations

import numpy as np

from aatri.adapters.frame.adjustment_frame import frame_notes, poses_out_of
from aatri.adapters.imported import read_at
from aatri.adapters.sanity_as_given import cameras_of
from aatri.arrays import Float, Int
from aatri.artifacts.block import Block
from aatri.errors import InputError
from aatri.notes import Note
from aatri.observations.control import control_of
from aatri.observations.poses import Poses
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.plausibility.cameras import camera_notes, control_notes
from aatri.orientation.plausibility.control import misplaced_control


def control_as_given(block: Block) -> tuple[list[InputError], tuple[Note, ...]]:
    """Control that lies off the block as it is given: what is certain as errors, the rest as warnings.

    Positions are those of exterior.csv, observed or approximate.
    """
    xyz, ids, image, control = _control(block)
    position = np.full((len(block.images), 3), np.nan)
    position[block.exterior.image] = block.exterior.position_m
    errors, notes = [], []
    rows = block.ground_points
    for found in misplaced_control(ids, xyz[:, :2], position[:, :2], control, image):
        row = int(control_of(block).row[found.rows[0]])
        where = read_at(block, rows, row)
        if found.certain:
            errors.append(InputError(found.text, where=where, remedy=found.remedy))
        else:
            notes.append(Note("warning", f"{where}: {found.text}; {found.remedy}".removeprefix(": ")))
    return errors, tuple(notes)


def sanity(block: Block, position_m: Float, ground_from_image: Float, xyz_m: Float) -> tuple[Note, ...]:
    """One line per camera and one of the control: field of view, flying height, scale, control inside the footprints.

    Parameters
    ----------
    block : Block
    position_m, ground_from_image : (n, 3), (n, 3, 3) float64, m
        Of the block's images, in its first frame; NaN where not oriented.
    xyz_m : (p, 3) float64, m
        Of the block's points; NaN where not known.

    Returns
    -------
    tuple of Note
    """
    cameras = cameras_of(block)
    of_image = block.images.camera
    rows = np.flatnonzero(block.image_points.active & block.images.active[block.image_points.image])
    points = block.image_points
    xyz, ids, image, control = _control(block)
    return (
        *camera_notes(cameras, of_image, position_m, ground_from_image, xyz_m, points.image[rows], points.point[rows]),
        *control_notes(cameras, of_image, position_m, ground_from_image, ids, xyz, image, control),
    )


def _control(block: Block) -> tuple[Float, list[str], Int, Int]:
    """Control points (coordinates that are no control are NaN), their ids, and which image shows which of them."""
    control = control_of(block)
    number = np.full(len(block.points), -1)
    number[control.point] = np.arange(len(control.point))
    points = block.image_points
    active = points.active & block.images.active[points.image] & (number[points.point] >= 0)
    xyz = np.where(control.given, control.xyz_m, np.nan)
    return xyz, block.points.id[control.point].tolist(), points.image[active], number[points.point[active]]


def of_start(block: Block, given: BundleInput, *, check: bool) -> tuple[Note, ...]:
    """What there is to say before a bundle: of its frame, and if wanted of the orientations it starts from."""
    frame = given.given.frame if given.given is not None else None
    poses = poses_out_of(frame, Poses(given.poses.position_m + given.origin_m, given.poses.ground_from_image))
    xyz = given.xyz_m + given.origin_m
    xyz = xyz if frame is None else frame.to_block(xyz)
    notes = frame_notes(block, frame, poses.position_m, xyz)
    geocentric = frame is not None and frame.geocentric
    if not check or given.rays is None or geocentric:
        return notes
    return (*notes, *sanity(block, poses.position_m, poses.ground_from_image, xyz))
