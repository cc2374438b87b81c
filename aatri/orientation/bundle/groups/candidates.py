"""Candidate groups: what observations of one kind may have in common, unit by unit, as derivatives of residuals."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from aatri.adjustment.elimination.effects import Effects
from aatri.arrays import Bool, Float, Int, Text
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.result import BundleResult

ALL = "all"
"""The unit of a whole kind."""

IMAGE = "image"
"""The unit of the points of one image."""

ENOUGH = 10
"""Units from which on most of them are right, and tell what units have in common without being wrong."""

MOST_TYPICAL = 24
"""Images that tell what images and their neighbourhoods have in common where nothing is wrong with them."""

NEIGHBOURHOOD = "neighbourhood"
"""What units of image points near each other are."""

MARK = "mark"
"""What units of a portable frame are, and of control with full covariances: a part of one record, that is used without
it."""


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

    The median knows nothing of the units that are wrong; that of fewer than `ENOUGH` says nothing.

    Parameters
    ----------
    gains : (n,) float64
        Of units of the whole block, chosen without regard to their residuals.
    """
    chance = variance * float(chdtri(degrees, 0.5)) if len(gains) >= ENOUGH and degrees > 0 else 0.0
    return max(1.0, float(np.median(gains)) / chance) if chance > 0 else 1.0


CandidatesOf = Callable[[BundleInput, BundleResult], Iterator[Candidates]]
