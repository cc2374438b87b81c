"""What attitudes tell when they are held against the orientations of the images: a wrong convention.

    exp([b]x) = R_obs' B' R      of every image: the turn of the camera that its attitude lacks

Where the b scatter by more than angles can err, the angles are tried in the other conventions in use: the other system,
opposite signs, the transposed matrix, another mount; the one in which they agree is proposed. What all b of a camera
have in common, its boresight, is tested after the adjustment, with the covariance of the orientations.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State
from aatri.arrays import Float
from aatri.errors import InputError
from aatri.geometry.rotations import angle_axes, body_from_mount, log_rotation, nearest_rotation
from aatri.geometry.vectors import finite_rows
from aatri.notes import Note
from aatri.observations.poses import POSE

if TYPE_CHECKING:
    from aatri.artifacts.block import Block

WRONG_RAD, AGREES = np.radians(1.0), 0.2
"""Attitudes that scatter by more are in another convention, if one is found that scatters by this share of it."""

SAME = 1.2
"""Readings that agree up to this factor are one: some are the same rotations by other names; the simplest is told."""

LEAST = 3
"""Fewer images say nothing of a convention."""

NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])

Remarks = Callable[[State, bool], tuple[Note, ...]]


def remarks_on(block: Block, rows: Any, records: Records) -> Remarks:
    """What to say of attitudes, given orientations: before the adjustment those of `initial`, after it the adjusted.

    Parameters
    ----------
    block : Block
    rows : Attitudes
    records : Records
    """

    def remarks(state: State, before: bool) -> tuple[Note, ...]:
        rotation = rows.axes.swapaxes(1, 2) @ state[POSE].ground_from_image[rows.image]
        usable = finite_rows(rotation) & finite_rows(rows.observed) & records.active
        notes: list[Note] = []
        for camera in np.unique(rows.camera[usable]):
            mine = np.flatnonzero(usable & (rows.camera == camera))
            name = str(block.cameras.id[camera])
            if len(mine) >= LEAST and _scatter(rows.observed[mine], rotation[mine]) > WRONG_RAD:
                notes += _of_convention(block, rows, mine, rotation[mine], name, before)
        return tuple(notes)

    return remarks


def _of_convention(block: Block, rows: Any, mine: Any, rotation: Float, camera: str, before: bool) -> list[Note]:
    angles = block.exterior.angles_rad[rows.row[mine]]
    declared = _scatter(rows.observed[mine], rotation)
    found = [(_scatter(R, rotation), what) for what, R in _readings(angles)]
    least = min(found)[0]
    best = next(reading for reading in found if reading[0] <= SAME * least)
    text = (
        f"attitudes of camera {camera} as {block.rotation} do not agree with the orientations of its images: they "
        f"differ by {np.degrees(declared):.3g} deg beyond any common offset"
    )
    if best[0] > AGREES * declared:
        return [Note("warning", f"{text}; check the angle system, its unit and the times of the attitudes")]
    proposal = f"read as {best[1]} they agree to {np.degrees(best[0]):.2g} deg"
    if before:
        raise InputError(
            f"{text}; {proposal}",
            where=f"block {block.name}",
            remedy=f"declare them as {best[1]} (rotation, heading, mount in block.yaml)",
        )
    return [Note("warning", f"{text}; {proposal}")]


def _scatter(observed: Float, rotation: Float) -> float:
    """Median turn between attitudes and orientations beyond a common one, rad."""
    lacking = observed.swapaxes(1, 2) @ rotation
    common = nearest_rotation(np.median(lacking, axis=0))
    return float(np.median(np.linalg.norm(log_rotation(lacking @ common.T), axis=1)))


def _readings(angles: Float) -> Iterator[tuple[str, Float]]:
    """The same angles in other conventions: what it is called, and R_obs; the simplest first."""
    names = {
        "omega-phi-kappa": ("omega", "phi", "kappa"),
        "phi-omega-kappa": ("phi", "omega", "kappa"),
        "roll-pitch-heading": ("roll", "pitch", "heading"),
    }
    flips = sorted(itertools.product((1, -1), repeat=3), key=lambda s: -sum(s))
    for transposed, signs, system in itertools.product((False, True), flips, names):
        R, _ = angle_axes(angles * np.array(signs), system)
        turned = [name for name, sign in zip(names[system], signs) if sign < 0]
        what = system + (f" with {', '.join(turned)} of opposite sign" if turned else "")
        if transposed:
            what, R = f"{what}, the transposed matrix (image from ground)", R.swapaxes(1, 2)
        if system == "roll-pitch-heading":
            R = NED @ R @ body_from_mount(np.zeros(len(R)))
        yield what, R
    for a, b in ((0, 1), (1, 2), (0, 2)):
        order = [0, 1, 2]
        order[a], order[b] = order[b], order[a]
        for system in names:
            R, _ = angle_axes(angles[:, order], system)
            if system == "roll-pitch-heading":
                R = NED @ R @ body_from_mount(np.zeros(len(R)))
            yield f"{system} with a{a + 1} and a{b + 1} exchanged", R
