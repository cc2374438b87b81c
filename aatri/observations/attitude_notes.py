"""What attitudes tell when they are held against the orientations of the images: a common offset, a wrong convention.

    exp([b]x) = R_obs' B' R      of every image: the turn of the camera that its attitude lacks

The median of b over the images of a camera is its common offset; where the boresight is fixed and the offset is beyond
three times its standard deviation (from scatter and standard deviations), it is a warning with the value. Where the b
scatter by more than angles can err, the angles are tried in the other conventions in use: the other system, opposite
signs, the transposed matrix, another mount; the one in which they agree is proposed.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float
from aatri.errors import InputError
from aatri.geometry.carrier import angle_axes, body_from_mount, log_vector
from aatri.geometry.rotations import nearest_rotation
from aatri.geometry.vectors import finite_rows
from aatri.notes import Note
from aatri.observations.poses import POSE

if TYPE_CHECKING:
    from aatri.artifacts.block import Block

LIMIT = 3.0
"""Common offsets beyond so many of their standard deviations are told."""

WRONG_RAD, AGREES = np.radians(1.0), 0.2
"""Attitudes that scatter by more are in another convention, if one is found that scatters by this share of it."""

SAME = 1.2
"""Readings that agree up to this factor are one: some are the same rotations by other names; the simplest is told."""

LEAST = 3
"""Fewer images say nothing of a convention."""

NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])

Remarks = Callable[[State, bool], tuple[Note, ...]]


def remarks_on(block: Block, rows: Any, records: Records, fixed: Bool) -> Remarks:
    """What to say of attitudes, given orientations: before the adjustment those of `initial`, after it the adjusted.

    Parameters
    ----------
    block : Block
    rows : Attitudes
    records : Records
    fixed : (n_cameras,) bool
        The boresight of the camera is fixed.
    """

    def remarks(state: State, before: bool) -> tuple[Note, ...]:
        rotation = rows.axes.swapaxes(1, 2) @ state[POSE].ground_from_image[rows.image]
        usable = finite_rows(rotation) & finite_rows(rows.observed) & records.active
        notes: list[Note] = []
        for camera in np.unique(rows.camera[usable]):
            mine = np.flatnonzero(usable & (rows.camera == camera))
            lacking = log_vector(rows.observed[mine].swapaxes(1, 2) @ rotation[mine])
            name = str(block.cameras.id[camera])
            if len(mine) >= LEAST and _scatter(rows.observed[mine], rotation[mine]) > WRONG_RAD:
                notes += _of_convention(block, rows, mine, rotation[mine], name, before)
            elif (fixed[camera] and not before) or (fixed[camera] and len(mine) >= LEAST):
                notes += _of_offset(lacking - block.cameras.boresight_rad[camera], rows.sigma_rad[mine], name)
        return tuple(notes)

    return remarks


def _of_offset(lacking: Float, sigma: Float, camera: str) -> list[Note]:
    """The common offset, where it is beyond its standard deviation."""
    n = len(lacking)
    median = np.median(lacking, axis=0)
    scatter = 1.4826 * np.median(np.abs(lacking - median), axis=0)
    one = np.sqrt(scatter**2 + (sigma**2).mean())
    error = one if n == 1 else 1.2533 * one / np.sqrt(n)
    ratio = float(np.max(np.abs(median) / error))
    if ratio <= LIMIT:
        return []
    x, y, z = np.degrees(median)
    text = (
        f"attitudes of camera {camera} have a common offset of {x:.4f}, {y:.4f}, {z:.4f} deg about its axes "
        f"({n} images, {ratio:.0f} times its standard deviation), but its boresight is fixed: "
        "let it free (sigmas: {boresight: .inf}), or give it"
    )
    return [Note("warning", text)]


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
        raise InputError(f"{text}; {proposal}", where=f"block {block.name}",
                         remedy=f"declare them as {best[1]} (rotation, heading, mount in block.yaml)")  # fmt: skip
    return [Note("warning", f"{text}; {proposal}")]


def _scatter(observed: Float, rotation: Float) -> float:
    """Median turn between attitudes and orientations beyond a common one, rad."""
    lacking = observed.swapaxes(1, 2) @ rotation
    common = nearest_rotation(np.median(lacking, axis=0))
    return float(np.median(np.linalg.norm(log_vector(lacking @ common.T), axis=1)))


def _readings(angles: Float) -> Iterator[tuple[str, Float]]:
    """The same angles in other conventions: what it is called, and R_obs; the simplest first."""
    names = {"omega-phi-kappa": ("omega", "phi", "kappa"), "phi-omega-kappa": ("phi", "omega", "kappa"),
             "roll-pitch-heading": ("roll", "pitch", "heading")}  # fmt: skip
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
