"""A problem as it is stated: unknowns, observations, and what must hold exactly."""

from dataclasses import dataclass

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import Unknowns


@dataclass(frozen=True)
class Problem:
    """A problem of least squares."""

    unknowns: tuple[Unknowns, ...]
    records: tuple[Records, ...]
    """Observations, active or not."""
    constraints: tuple[Records, ...] = ()
    """What must hold exactly, given like observations; see `constraints`."""
