"""A problem as it is stated: unknowns, observations, and what must hold exactly."""

from dataclasses import dataclass

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import Unknowns


@dataclass(frozen=True)
class Problem:
    """A problem of least squares.

    Attributes
    ----------
    unknowns : tuple of Unknowns
    records : tuple of Records
        Observations, active or not.
    constraints : tuple of Records
        What must hold exactly, given like observations; see `constraints`.
    """

    unknowns: tuple[Unknowns, ...]
    records: tuple[Records, ...]
    constraints: tuple[Records, ...] = ()
