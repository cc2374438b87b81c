"""What cameras carry: the lever arm of the antenna and the boresight of the IMU; fixed, weighted or free.

A component is unknown where the block gives it a standard deviation (`lever_arm`, `boresight` under `sigmas` of the
camera): weighted where it is finite, free where it is infinite; a weighted component is an observation of its own.
Positions that refer to an antenna touch the arm of their camera,

    v = X0 + R a - X_observed,    dv/da = R,

and attitudes its boresight (`attitudes`). Source: docs/formulas.md 5.2, 5.6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from aatri.adjustment.unknowns import Unknowns, add_step
from aatri.arrays import Bool, Float, Int
from aatri.observations.coordinates import observed_priors
from aatri.observations.observed import Observed

if TYPE_CHECKING:
    from aatri.artifacts.block import Block

LEVER_ARM, BORESIGHT = "lever arm", "boresight"
"""Names of the groups of unknowns, a block for each camera."""


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
