"""Exact constraints by the thousand: as observations of so large a weight that they hold to a millionth of a sigma.

Multipliers (`constraints`) take a dense matrix of unknowns times constraints. Beyond some hundreds they enter as
records of STIFF times the weight at which they would only just be felt (rho of `constraints.support`): sparse, with
the fill-in of an observation. With N the other observations the violation is

    c = (R C N^-1 C' + I)^-1 c_0,    R = STIFF rho,    rho C N^-1 C' of the order of 1:    |c| about |c_0| / STIFF

c_0 what the adjustment without them would violate; covariances differ from the exact ones by the same share, 1e-6. What
is not held at the end is contradictory, and refused. Source: penalty method, Nocedal & Wright, ch. 17.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aatri.adjustment.constraints.multipliers import support
from aatri.adjustment.records import Records, whitened
from aatri.adjustment.unknowns import State, Unknowns
from aatri.errors import GeometryError
from aatri.notes import Note

MOST_BY_MULTIPLIERS = 400
"""Scalar constraints beyond which they are stiff observations."""

STIFF = 1e6

HELD = 0.05
"""Largest violation at the end, in units of 1 / sqrt(rho): of the standard deviation that would only just be felt."""


@dataclass(frozen=True)
class StiffConstraints:
    """Constraints that stand among the observations."""

    records: tuple[Records, ...] = ()
    conditions: tuple[Records, ...] = ()
    """The same with the weight rho."""

    @property
    def count(self) -> int:
        """Scalar constraints."""
        return sum(r.observations for r in self.records)

    def notes(self) -> list[Note]:
        """What there is to say of it."""
        if not self.records:
            return []
        text = f"{self.count} exact conditions are held by weights, to about {1 / STIFF:.0e} of a standard deviation"
        return [Note("note", text)]

    def refuse_violated(self, state: State) -> None:
        """Refuse what does not hold.

        Raises
        ------
        GeometryError
            If exact conditions contradict each other; the message names the worst.
        """
        worst = []
        for r in self.conditions:
            size = np.abs(whitened(r, state, np.arange(len(r.active)))[0]).max(axis=1)
            worst += [(float(size[k]), r.called(int(k))) for k in np.argsort(-size)[:3] if size[k] > HELD]
        if worst:
            names = ", ".join(name for _, name in sorted(worst, reverse=True)[:4])
            raise GeometryError(f"exact conditions contradict each other: {names}", remedy="leave one of them out")


def stiffened(
    unknowns: Sequence[Unknowns], records: Sequence[Records], constraints: Sequence[Records], state: State
) -> StiffConstraints:
    """The constraints as stiff observations, where they are many; else nothing."""
    if sum(r.observations for r in constraints) <= MOST_BY_MULTIPLIERS:
        return StiffConstraints()
    conditions = support(unknowns, records, constraints, state)
    return StiffConstraints(tuple(replace(r, whitener=np.sqrt(STIFF) * r.whitener) for r in conditions), conditions)
