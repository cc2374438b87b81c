"""Unknowns: groups of blocks of equal size, with a status per scalar and a manifold.

A group is, say, all poses (blocks of 6) or all ground points (blocks of 3). A scalar is free or held: held scalars are
fixed, or absent as the height of a plan-only point. Weighted unknowns are free ones with a prior record.

A group marked `eliminated` is eliminated block by block before all others, unless an observation joins two of its
blocks or a block has very many rays: such blocks are retained. A group that `joins` another stands and falls with it,
block by block: the two share their place in the order of elimination.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from aatri.arrays import Bool, Float, Text

Ids = Sequence[str] | Text
State = Mapping[str, Any]
"""Values of all groups, by name."""


@dataclass(frozen=True)
class Unknowns:
    """One group of unknowns."""

    name: str
    free: Bool
    """(n, k). False where the scalar is held."""
    labels: tuple[str, ...]
    """Names of the k scalars of a block."""
    ids: Ids
    """Names of the n blocks."""
    retract: Callable[[Any, Float], Any]
    """(value of the group, step (n, k)) -> value of the group: the manifold's update."""
    eliminated: bool = False
    joins: str = ""
    """Name of a group listed before, or empty."""
    position: Float | None = None
    """(n, d). Where the blocks lie, for the order of elimination; NaN unknown."""
    generator: Callable[[State], Float] | None = None
    """State -> (n, k, 7): how the blocks move with three shifts, three rotations about the origin and a change of scale
    of the object space; absent: not at all."""
    implausible: Float | None = None
    """(k,). Standard deviations a priori beyond which a scalar counts as open, see `openness.nearly_open`."""
    retained: Bool | None = None
    """(n,). Blocks of an eliminated group that are kept all the same."""
    shared: Bool | None = None
    """(n,). Blocks that other parts of the problem have, too: they are kept, and none of them is eliminated here."""

    @property
    def size(self) -> int:
        """Scalars per block."""
        return int(self.free.shape[1])

    def label(self, block: int, scalar: int) -> str:
        """Name of one unknown, as in `phi of image 319`."""
        return f"{self.labels[scalar]} of {self.name} {self.ids[block]}"


def add_step(value: Float, step: Float) -> Float:
    """The manifold of plain numbers."""
    return np.asarray(value + step)


def retract_state(unknowns: Sequence[Unknowns], state: State, steps: Mapping[str, Float]) -> dict[str, Any]:
    """The state after a step."""
    return {**state, **{u.name: u.retract(state[u.name], steps[u.name]) for u in unknowns}}
