"""Candidate groups: what observations of one kind may have in common, unit by unit, as derivatives of residuals.

What a camera may be wrong in is made for those image points that are asked for:

    dv/dc = (x, y) / c,   dv/dx0 = (1, 0),   dv/dy0 = (0, 1),   dv/dp = -(x, y) r^2 / r0^3
    affinity:  dv/da = (-x, y) / r0,   dv/db = (-y, -x) / r0

with x, y the photo coordinates, r their distance from the principal point, r0 half the diagonal of the format.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from aatri.adjustment.elimination.effects import Effects
from aatri.arrays import Bool, Float, Int, Text
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.groups.limits import ENOUGH_UNITS
from aatri.orientation.bundle.result import BundleResult

AFFINITY = 4
"""First of the columns of affinity and shear, the last two."""

ALL = "all"
"""The unit of a whole kind."""

IMAGE = "image"
"""The unit of the points of one image."""

NEIGHBOURHOOD = "neighbourhood"
"""What units of image points near each other are."""

MARK = "mark"
"""What units of a portable frame are, and of control with full covariances: a part of one record, that is used without
it."""


@dataclass(frozen=True)
class CameraEffects:
    """Derivatives by c, x0, y0, radial distortion at r0, affinity and shear at r0, (n, 2, 6)."""

    xy_mm: Float
    """(n, 2)."""
    c_mm: Float
    r0_mm: Float
    """(n,)."""

    @property
    def shape(self) -> tuple[int, int, int]:
        """n, 2 and 6."""
        return len(self.xy_mm), 2, AFFINITY + 2

    def __getitem__(self, rows: Int | Bool | slice, /) -> Float:
        """Those of some image points."""
        xy_mm, r0_mm = self.xy_mm[rows], self.r0_mm[rows]
        H, x = np.zeros((len(xy_mm), 2, AFFINITY + 2)), xy_mm / r0_mm[:, None]
        H[:, :, 0] = xy_mm / self.c_mm[rows][:, None]
        H[:, 0, 1] = H[:, 1, 2] = 1.0
        H[:, :, 3] = -x * (x**2).sum(axis=1, keepdims=True)
        H[:, 0, AFFINITY], H[:, 1, AFFINITY] = -x[:, 0], x[:, 1]
        H[:, 0, AFFINITY + 1], H[:, 1, AFFINITY + 1] = -x[:, 1], -x[:, 0]
        return H


@dataclass(frozen=True)
class Cause:
    """Columns of H that say the same thing: what it is called, see `messages`."""

    name: str
    columns: tuple[int, ...]
    loosens: bool = False
    """The block estimates it with a weight that is no measurement: of what explains as much this is the least."""


@dataclass(frozen=True)
class UnitMembers:
    """Observations of units."""

    rows: Int
    unit: Int
    """(n,). The unit of each."""
    H: Float
    """(n, m, k)."""


@dataclass(frozen=True)
class Candidates:
    """What the observations of a kind may have in common, unit by unit."""

    place: int
    """Of the kind among the observations."""
    per: str
    """What a unit is: strip, flight, camera, neighbourhood, all."""
    units: Text
    """(u,) str."""
    rows: Int
    unit: Int
    """(n,). Observations in use, and the unit of each."""
    H: Effects
    """(n, m, k). Derivatives of the residuals, in units of the observation."""
    causes: tuple[Cause, ...]
    removable: bool = False
    """A unit that is wrong may be left out."""
    tests: int = 0
    """Units among which these were chosen, where they are not all."""
    least_left: float = 0.0
    """Share of an effect on a unit, of what the ground points leave of it, that the images leave at least: units that
    could not be significant by it need not be solved for. 0: not known."""
    typical: Bool | None = None
    """(u,). Units that were chosen without regard to their residuals: where all of these have something in common that
    the model does not know, one is wrong that has more."""
    dispersion: Float | None = None
    """(u,). The same where it is known: how many times the squares of units like these are those of chance."""
    estimated_of: Bool | None = None
    """(u, c). Cameras that a unit sees with, of which the block estimates what its causes are."""
    rejected: UnitMembers | None = None
    """Observations of the units that are not in use: with what is wrong carried they may come back."""


def dispersion_of(gains: Float, degrees: int, variance: float = 1.0) -> float:
    """How many times the gains of units are those of chance, chi-square times a variance; at least 1.

    The median knows nothing of the units that are wrong; that of fewer than `ENOUGH_UNITS` says nothing.

    Parameters
    ----------
    gains : (n,) float64
        Of units of the whole block, chosen without regard to their residuals.
    """
    chance = variance * float(chdtri(degrees, 0.5)) if len(gains) >= ENOUGH_UNITS and degrees > 0 else 0.0
    return max(1.0, float(np.median(gains)) / chance) if chance > 0 else 1.0


CandidatesOf = Callable[[BundleInput, BundleResult], Iterator[Candidates]]
