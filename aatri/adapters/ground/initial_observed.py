"""What an initial orientation takes of the ground: control, observed positions, distances, attitudes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.adapters.frame.adjustment_frame import frame_of, geodesy_of
from aatri.adapters.ground.direct import boresight_sigma
from aatri.adapters.strips import oriented_strips as pieces
from aatri.arrays import Float, Int, Text
from aatri.artifacts.block import Block
from aatri.codes import OBSERVED_VALUE
from aatri.geometry.rotations import exp_rotation
from aatri.notes import Note
from aatri.observations.attitudes import attitudes_of
from aatri.observations.control import Control, control_of
from aatri.observations.geodetic.distances import HORIZONTAL, KIND
from aatri.observations.geodetic.sights import sights_of
from aatri.observations.observed import Given
from aatri.observations.poses import POSE, Poses
from aatri.observations.positions import Positions, positions_of
from aatri.observations.relative.distances import KIND as RELATIVE
from aatri.observations.relative.distances import relative_sights
from aatri.orientation.bodies.given_relations import Lengths

USES = (
    "geodetic:distance",
    "geodetic:distance_to_image",
    "geodetic:horizontal_distance",
    "geodetic:horizontal_distance_to_image",
    "geodetic.heights",
    "relative_control:distance",
    "exterior.angles_rad",
    "cameras.boresight_rad",
    "cameras.mount_deg",
)


@dataclass(frozen=True)
class SeenAttitudes:
    """Observed attitudes in the frame of the adjustment.

    Attributes
    ----------
    row, image : (n,) int
        Rows in exterior and images.
    ground_from_image : (n, 3, 3) float64
        With the boresight.
    turning : (n, 3, 3) float64
        Axes about which the angles turn, columns.
    covariance_rad2 : (n, 3, 3) float64, rad^2
        Of the angles. The error of a boresight, which all images of a camera share, counts as many times as there are
        images, so that the mean of them has the variance it should have.
    """

    row: Int
    image: Int
    ground_from_image: Float
    turning: Float
    covariance_rad2: Float

    def take(self, rows: Int) -> SeenAttitudes:
        """The chosen ones."""
        return SeenAttitudes(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


@dataclass(frozen=True)
class Ground:
    """What is known of the ground, and where coordinates are reduced to."""

    control: Control
    positions: Positions
    origin_m: Float
    lengths: tuple[Lengths, ...]
    attitudes: SeenAttitudes
    notes: tuple[Note, ...]


def ground_of(block: Block, as_given: Block, *, use_positions: bool) -> Ground:
    """What is known of a block.

    Parameters
    ----------
    block : Block
        In the frame of the adjustment.
    as_given : Block
        In its own.
    use_positions : bool
    """
    control, positions = control_of(block), positions_of(block)
    if not use_positions:
        positions = positions.take(np.zeros(0, dtype=np.int64))
    lengths, notes = _lengths(block)
    attitudes, more = seen_attitudes(as_given)
    return Ground(control, positions, pieces.origin_of(control, positions), lengths, attitudes, (*notes, *more))


def _lengths(block: Block) -> tuple[tuple[Lengths, ...], list[Note]]:
    """Distances as they are in space or in the horizon; a note of the others."""
    found, notes = [], []
    for kind in (KIND, HORIZONTAL):
        sights = sights_of(block, kind)
        usable = np.isin(sights.reduced, ("no", "horizon")) & (sights.group == "") & (sights.value > 0)
        plan = (sights.reduced == "horizon") | np.full(len(sights), kind == HORIZONTAL)
        found.append(Lengths(kind, sights.take(usable), plan[usable]))
        if not usable.all():
            ids: Text = sights.names[~usable]
            text = (
                f"{kind}: {len(ids)} take no part here, as their group has a scale of its own or they are reduced "
                "to another surface; the bundle uses them"
            )
            notes.append(Note("note", text, tuple(ids.tolist())))
    sights = relative_sights(block)
    found.append(Lengths(RELATIVE, sights, np.zeros(len(sights), dtype=bool)))
    return tuple(part for part in found if len(part.sights)), notes


def seen_attitudes(block: Block) -> tuple[SeenAttitudes, list[Note]]:
    """Attitudes of cameras whose boresight is known or weighted; a note of the others."""
    if not (block.exterior.angle_use == OBSERVED_VALUE).any():  # nothing to convert: the frame may be none
        none: Int = np.zeros(0, dtype=np.int32)
        return SeenAttitudes(none, none, *(np.zeros((0, 3, 3)) for _ in range(3))), []
    frame, n = frame_of(block), len(block.images)
    nowhere = Poses(np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan))
    rows = attitudes_of(Given(block, None, np.zeros(3), {POSE: nowhere}, frame=frame, geodesy=geodesy_of(block, frame)))
    p = block.camera_parameters
    open_ = np.unique(p.camera[np.char.startswith(p.name, "boresight.") & p.free])
    usable = np.flatnonzero(rows.whole & ~np.isin(rows.camera, open_))
    camera = rows.camera[usable]
    R = rows.axes[usable] @ rows.observed[usable] @ exp_rotation(block.cameras.boresight_rad[camera])
    G = rows.axes[usable] @ rows.turning[usable]
    back = np.linalg.inv(G) @ R
    shared = boresight_sigma(block)[camera] ** 2 * np.bincount(camera, minlength=1)[camera][:, None]
    covariance = (rows.sigma_rad[usable] ** 2)[:, :, None] * np.eye(3)
    covariance = covariance + back @ (shared[:, :, None] * np.eye(3)) @ back.swapaxes(1, 2)
    notes = []
    if not rows.whole.all():
        ids = tuple(block.images.id[rows.image[~rows.whole]].tolist())
        notes.append(
            Note("note", "attitudes of which one or two angles are given take no part here; the bundle uses them", ids)
        )
    if np.isin(rows.camera, open_).any():
        ids = tuple(block.cameras.id[np.intersect1d(open_, rows.camera)].tolist())
        notes.append(Note("note", "attitudes of cameras whose boresight is free take no part here", ids))
    return SeenAttitudes(rows.row[usable], rows.image[usable], R, G, covariance), notes
