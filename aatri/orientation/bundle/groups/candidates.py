"""Candidate groups: what observations of one kind may have in common, unit by unit, as derivatives of residuals."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from aatri.arrays import Float, Int, Text
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.result import BundleResult

ALL = "all"
"""The unit of a whole kind."""

IMAGE = "image"
"""The unit of the points of one image."""

NEIGHBOURHOOD = "neighbourhood"
"""What units of image points near each other are."""


@dataclass(frozen=True)
class Cause:
    """Columns of H that say the same thing: what it is called, see `messages`."""

    name: str
    columns: tuple[int, ...]


@dataclass(frozen=True)
class Candidates:
    """What the observations of a kind may have in common, unit by unit.

    Attributes
    ----------
    place : int
        Of the kind among the observations.
    per : str
        What a unit is: strip, flight, camera, neighbourhood, all.
    units : (u,) str
    rows, unit : (n,) int
        Observations in use, and the unit of each.
    H : (n, m, k) float64
        Derivatives of the residuals, in units of the observation.
    causes : tuple of Cause
    removable : bool
        A unit that is wrong may be left out.
    tests : int
        Units among which these were chosen, where they are not all.
    least_left : float
        Share of an effect on a unit, of what the ground points leave of it, that the images leave at least: units that
        could not be significant by it need not be solved for. 0: not known.
    """

    place: int
    per: str
    units: Text
    rows: Int
    unit: Int
    H: Float
    causes: tuple[Cause, ...]
    removable: bool = False
    tests: int = 0
    least_left: float = 0.0


CandidatesOf = Callable[[BundleInput, BundleResult], Iterator[Candidates]]
