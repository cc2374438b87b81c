"""A problem as it is stated: unknowns, observations, what must hold exactly, and how it is to be solved."""

from dataclasses import dataclass
from typing import Literal

from aatri.adjustment.others import Others
from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import Unknowns
from aatri.progress import NO_CHECKPOINT, Checkpoint, Workers

Ordering = Literal["auto", "nested_dissection", "minimum_degree", "across_strips", "along_strips"]

Solver = Literal["auto", "direct", "conjugate_gradients"]


QUICK = 0.01
"""Decrement over that of the step before, below which the next is expected to be smaller by as much again: near its end
Gauss-Newton squares the error, or divides it by a constant factor where residuals are large. From 5 to 1e-3 that takes
two steps."""

ENOUGH, MOST = 30, 60
"""Iterations of an adjustment, and of one that still makes progress then: curved valleys of weak blocks."""


@dataclass(frozen=True)
class SolverSettings:
    """Settings of an adjustment."""

    max_iterations: int | None = None
    """Default: `ENOUGH`, and `MOST` where it still makes progress; see `goes_on`."""
    tolerance: float = 1e-3
    """Bound of the Newton decrement."""
    near_tolerance: float | None = None
    """Bound instead of `tolerance` as long as each decrement is less than `QUICK` of the one before."""
    ordering: Ordering = "auto"
    """`nested_dissection`, `minimum_degree`, `auto`: the better of the two, or for few vertices one front; or the
    chains `across_strips` and `along_strips`: by the second or the first coordinate of the blocks' positions."""
    threads: int | None = None
    """Default: all processors."""
    reproducible: bool = False
    """The same bits for any number of threads."""
    memory_gb: float | None = None
    """Limit of the memory; default: a share of the machine's."""
    solver: Solver = "auto"
    """`auto`, or one of `direct` and `conjugate_gradients` whatever the forecast; see `forecast`."""
    demands: str = ""
    """What was asked for that only a factor gives, in words: without the memory for it nothing is solved."""
    checkpoint: Checkpoint = NO_CHECKPOINT
    """Where long iterations are kept."""
    parts: int = 1
    """Parts in which the problem is adjusted, see `parts`."""
    workers: Workers | None = None
    """Who adjusts them; default: threads of this process."""
    others: Others | None = None
    """Of a part: all of them."""


@dataclass(frozen=True)
class Problem:
    """A problem of least squares."""

    unknowns: tuple[Unknowns, ...]
    records: tuple[Records, ...]
    """Observations, active or not."""
    constraints: tuple[Records, ...] = ()
    """What must hold exactly, given like observations; see `constraints`."""
