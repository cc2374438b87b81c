"""Sanity of a block from its tables: control against positions as given; with orientations, cameras and control.

Control whose numbers are exchanged is an error where the adjustment cannot leave it out: one of the two is exact, or
fewer than three other points would remain. Else it is a warning, and the search for gross errors decides.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from aatri.adapters.frame.adjustment_frame import frame_notes, poses_out_of
from aatri.adapters.imported import read_at
from aatri.adapters.sanity_as_given import cameras_of
from aatri.arrays import Float, Int
from aatri.artifacts.block import Block
from aatri.errors import InputError, raise_all
from aatri.geometry.intersection import intersect_rays
from aatri.geometry.vectors import finite_rows
from aatri.notes import Note
from aatri.observations.control import control_of
from aatri.observations.poses import Poses
from aatri.orientation.plausibility.cameras import camera_notes, control_notes
from aatri.orientation.plausibility.control import length, misplaced_control
from aatri.orientation.plausibility.exchanged import exchanged_at_start

if TYPE_CHECKING:  # readers of files import this, and need no method
    from aatri.orientation.bundle.block import BundleInput

ENOUGH_CONTROL = 3
"""Other control points without which an adjustment cannot leave out two."""


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
    """What there is to say before a bundle: of its frame, and if wanted of the orientations it starts from.

    Raises
    ------
    InputError
        If the numbers of control points are exchanged and the adjustment could not leave them out.
    """
    frame = given.given.frame if given.given is not None else None
    poses = poses_out_of(frame, Poses(given.poses.position_m + given.origin_m, given.poses.ground_from_image))
    xyz = given.xyz_m + given.origin_m
    xyz = xyz if frame is None else frame.to_block(xyz)
    notes = frame_notes(block, frame, poses.position_m, xyz)
    geocentric = frame is not None and frame.geocentric
    if not check or given.rays is None or geocentric:
        return notes
    errors, exchanged = _exchanged_control(block, given)
    raise_all(errors)
    return (*notes, *sanity(block, poses.position_m, poses.ground_from_image, xyz), *exchanged)


def _exchanged_control(block: Block, given: BundleInput) -> tuple[list[InputError], list[Note]]:
    """Control points that the start finds at each other's coordinates."""
    control, rays, frame = control_of(block), given.rays, given.given.frame if given.given is not None else None
    assert rays is not None
    number = np.full(len(block.points), -1)
    number[control.point] = np.arange(len(control.point))
    oriented = finite_rows(given.poses.position_m) & finite_rows(given.poses.ground_from_image)
    rows = np.flatnonzero(rays.active & oriented[rays.image] & (number[rays.point] >= 0))
    looking = np.column_stack([rays.xy_mm[rows], -rays.c_mm[rows]])
    direction = np.einsum("nij,nj->ni", given.poses.ground_from_image[rays.image[rows]], looking)
    found = intersect_rays(
        given.poses.position_m[rays.image[rows]], direction, number[rays.point[rows]], len(control.point)
    )
    found += given.origin_m
    found = found if frame is None else frame.to_block(found)
    known = np.where(control.given, control.xyz_m, np.nan)
    others = int(control.given.any(axis=1).sum()) - 2
    errors, notes = [], []
    for pair in exchanged_at_start(found, known):
        both = [pair.first, pair.second]
        first, second = block.points.id[control.point[both]].tolist()
        text = (f"control points {first} and {second} fit with their numbers exchanged: as given they lie "
                f"{length(pair.as_given_m)} from where the images find them, exchanged "
                f"{length(pair.exchanged_m)}")  # fmt: skip
        remedy = "exchange the two ids in the control, or in the images"
        if control.exact[both].any() or others < ENOUGH_CONTROL:
            where = read_at(block, block.ground_points, int(control.row[pair.first]))
            errors.append(InputError(text, where=where, remedy=remedy))
        else:
            notes.append(Note("warning", f"{text}; {remedy}"))
    return errors, notes
