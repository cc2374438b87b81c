"""Exposure-time offsets: the time at which a position was told is not that of the exposure, by dt for each camera.

    v = X0 + R a + u dt - X_observed,    dv/d(dt) = u

u is the velocity of the aircraft at the exposure, from the observed positions of its strip before and after it. dt is
positive where positions belong to a later moment than the exposure. Source: docs/formulas.md 5.3.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from aatri.adjustment.unknowns import Unknowns, add_step
from aatri.arrays import Float, Int
from aatri.errors import InputError
from aatri.ids import several, shown

if TYPE_CHECKING:
    from aatri.artifacts.block import Block

EXPOSURE_TIME = "exposure time"


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
