"""What cameras carry: the lever arm of the antenna and the boresight of the IMU; fixed, weighted or free.

A component is unknown where the block gives it a standard deviation (`lever_arm`, `boresight` under `sigmas` of the
camera): weighted where it is finite, free where it is infinite; a weighted component is an observation of its own.
Positions that refer to an antenna touch the arm of their camera,

    v = X0 + R a - X_observed,    dv/da = R,

and attitudes its boresight (`attitudes`). Source: docs/formulas.md 5.2, 5.6.

Exposure-time offsets: the time at which a position was told is not that of the exposure, by dt for each camera.

    v = X0 + R a + u dt - X_observed,    dv/d(dt) = u

u is the velocity of the aircraft at the exposure, from the observed positions of its strip before and after it. dt is
positive where positions belong to a later moment than the exposure. Source: docs/formulas.md 5.3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from aatri.adjustment.unknowns import Unknowns, add_step
from aatri.arrays import Bool, Float, Int
from aatri.errors import InputError
from aatri.ids import several, shown
from aatri.observations.given_coordinates import observed_priors
from aatri.observations.observed import Observed

if TYPE_CHECKING:
    from aatri.artifacts.block import Block


LEVER_ARM, BORESIGHT = "lever arm", "boresight"
"""Names of the groups of unknowns, a block for each camera."""

EXPOSURE_TIME = "exposure time"


@dataclass(frozen=True)
class CarriedVector:
    """A vector of each camera, in its axes: where the antenna is, how the IMU is turned."""

    group: str
    """Of unknowns."""
    name: str
    """Of its components in the camera parameters, before the axis."""
    labels: tuple[str, str, str]
    unit: str

    def open(self, block: Block) -> tuple[Bool, Float]:
        """Which components are unknown, and the standard deviations of the weighted ones (else 0), (n_cameras, 3)."""
        n, p = len(block.cameras), block.camera_parameters
        free, sigma = np.zeros((n, 3), dtype=bool), np.zeros((n, 3))
        for k, axis in enumerate("xyz"):
            rows = p.name == f"{self.name}.{axis}"
            prior_sigma = np.where(p.free[rows], 0.0, np.nan_to_num(p.sigma[rows]))
            free[p.camera[rows], k], sigma[p.camera[rows], k] = p.free[rows] | (prior_sigma > 0), prior_sigma
        return free, sigma

    def unknowns(self, block: Block, cameras: Int | None = None) -> Unknowns:
        """Of all cameras; free are those of some, where they are chosen."""
        free = self.open(block)[0]
        if cameras is not None:
            free &= np.isin(np.arange(len(free)), cameras)[:, None]
        return Unknowns(self.group, free, self.labels, block.cameras.id, add_step)

    def priors(self, block: Block, values: Float, unknowns: Unknowns) -> tuple[Observed, ...]:
        """What is known beforehand of the weighted components among the unknowns; values (n_cameras, 3)."""
        sigma = self.open(block)[1]
        C, weighted = sigma[:, :, None] ** 2 * np.eye(3), unknowns.free & (sigma > 0)
        ids = block.cameras.id
        return observed_priors(f"{self.name}_prior", self.group, ids, values, C, weighted, self.labels, self.unit)


ARMS = CarriedVector(LEVER_ARM, "lever_arm", ("lever x", "lever y", "lever z"), "m")
BORESIGHTS = CarriedVector(BORESIGHT, "boresight", ("boresight x", "boresight y", "boresight z"), "rad")


def offset_unknowns(block: Block) -> Unknowns:
    """One offset for each camera, s."""
    n = len(block.cameras)
    return Unknowns(EXPOSURE_TIME, np.ones((n, 1), dtype=bool), ("time offset",), block.cameras.id, add_step)


def velocities(block: Block, image: Int, position_m: Float) -> Float:
    """Velocity at each observed position, (n, 3) m/s, from its neighbours in the strip.

    Parameters
    ----------
    image : (n,) int
        Row in images.
    position_m : (n, 3) float64, m
        NaN where not given; the velocity there is zero.

    Raises
    ------
    InputError
        If an image has no time, or a given coordinate no other of another time beside it in the strip.
    """
    time, strip = block.images.time_s[image], block.images.strip[image]
    velocity = np.full((len(image), 3), np.nan)
    for s in np.unique(strip[strip >= 0]):
        rows = np.flatnonzero((strip == s) & np.isfinite(time))
        rows = rows[np.argsort(time[rows], kind="stable")]
        if len(rows) < 2:
            continue
        place = np.arange(len(rows))
        before, after = rows[np.maximum(place - 1, 0)], rows[np.minimum(place + 1, len(rows) - 1)]
        span = time[after] - time[before]
        moved = position_m[after] - position_m[before]
        velocity[rows] = np.where(span[:, None] > 0, moved / np.where(span > 0, span, 1.0)[:, None], np.nan)
    without = np.flatnonzero((~np.isfinite(velocity) & np.isfinite(position_m)).any(axis=1))
    if len(without):
        raise InputError(
            f"positions.time_offset: no velocity for {several(len(without), 'observed position')}, of images "
            f"{shown(block.images.id[image[without]].tolist())}: they need a time, a strip, and a neighbour in it",
            remedy="give `time` and `strip` in images.csv, or leave out time_offset",
        )
    return np.where(np.isfinite(velocity), velocity, 0.0)
