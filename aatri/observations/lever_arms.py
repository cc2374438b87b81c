"""Lever arms of cameras: antenna minus projection centre, in camera axes; fixed, weighted or free.

A component is unknown where the block gives it a standard deviation (`lever_arm` under `sigmas` of the camera):
weighted where it is finite, free where it is infinite. Positions that refer to an antenna touch the arm of their
camera,

    v = X0 + R a - X_observed,    dv/da = R,

and a weighted component is an observation of its own. Source: docs/formulas.md 5.2.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from aatri.adjustment.unknowns import Unknowns, add_step
from aatri.arrays import Bool, Float
from aatri.observations.coordinates import value_records
from aatri.observations.observed import Observed, named
from aatri.observations.parameters import uses_of_vector

if TYPE_CHECKING:
    from aatri.artifacts.block import Block

LEVER_ARM = "lever arm"

LABELS = ("lever x", "lever y", "lever z")

USES = uses_of_vector("lever_arm")


def open_arms(block: Block) -> tuple[Bool, Float]:
    """Which components are unknown, and the standard deviations of the weighted ones (else NaN), (n_cameras, 3)."""
    n = len(block.cameras)
    free, sigma = np.zeros((n, 3), dtype=bool), np.full((n, 3), np.nan)
    p = block.camera_parameters
    for k, axis in enumerate("xyz"):
        for row in np.flatnonzero(p.name == f"lever_arm.{axis}"):
            weighted = np.isfinite(p.sigma[row]) and p.sigma[row] > 0 and not p.free[row]
            free[p.camera[row], k] = p.free[row] or weighted
            if weighted:
                sigma[p.camera[row], k] = p.sigma[row]
    return free, sigma


def arm_unknowns(block: Block) -> Unknowns:
    """The arms of all cameras."""
    return Unknowns(LEVER_ARM, open_arms(block)[0], LABELS, block.cameras.id, add_step)


def arm_priors(block: Block) -> tuple[Observed, ...]:
    """What is known of weighted arms beforehand."""
    free, sigma = open_arms(block)
    weighted = free & np.isfinite(sigma)
    rows = np.flatnonzero(weighted.any(axis=1))
    if not len(rows):
        return ()
    covariance = np.where(weighted, sigma, 1.0)[rows][:, :, None] ** 2 * np.eye(3)
    records = value_records(
        "lever_arm_prior", LEVER_ARM, rows.astype(np.int32), block.cameras.lever_arm_m[rows], covariance, weighted[rows]
    )
    return (Observed(records, np.full(len(rows), -1), named(image=block.cameras.id[rows]), "m", components=LABELS),)
