"""What an adjustment gives."""

from dataclasses import dataclass
from typing import Any

from aatri.adjustment.constraints.multipliers import factorise_constrained
from aatri.adjustment.elimination.factor import Factored
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.notes import Note


@dataclass(frozen=True)
class Step:
    """One line of the history."""

    cost: float
    decrement: float
    damping: float
    """Before the step."""
    strayed: bool = False
    """The linear step was not taken as it was: refused, damped, or taken with the eliminated blocks moved on."""


@dataclass(frozen=True)
class Adjusted:
    """A converged adjustment."""

    state: dict[str, Any]
    """Adjusted values of all groups."""
    problem: IndexedProblem
    cost: float
    """v'v at the solution, or what a robust loss makes of it."""
    observations: int
    n_unknowns: int
    redundancy: int
    """The redundancy counts the constraints."""
    sigma0: float
    """sqrt(v'v / redundancy), NaN without redundancy and where observations are down-weighted."""
    history: tuple[Step, ...]
    down_weighted: int = 0
    """Records beyond the bound of their loss. Unless 0 the solution is not one of least squares: it has no sigma0 and
    no covariances."""
    factored: Factored | None = None
    """Of a linear problem its only factor, which serves the covariances; of others where it was asked for. In a file it
    may have been given back: `factor_of` makes it again."""
    notes: tuple[Note, ...] = ()
    """What takes no part, was set aside, has no finite optimum, or is hardly determined."""

    @property
    def has_factor(self) -> bool:
        """Whether covariances can be asked for: the problem was solved by its factor."""
        return self.problem.iterative is None


def factor_of(adjusted: Adjusted) -> Factored:
    """The factorised linearisation at the solution: the one that is kept, or made again."""
    kept = adjusted.factored
    if kept is not None and not kept.factor.is_cleared:
        return kept
    return factorise_constrained(adjusted.problem, adjusted.state)
