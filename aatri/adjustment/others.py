"""The other parts of a problem that is adjusted in parts, as each of them meets them.

Every part goes through the same iterations. What decides on their course (cost, decrease, vetoes) is that of all parts
together, and the same number for each; unknowns that parts share are solved for by who joins the parts.
"""

from dataclasses import dataclass
from typing import Protocol

from aatri.arrays import Float, Int


class NotInParts(Exception):
    """What only the whole problem shows: an unknown that is not determined, an iteration that does not converge."""


@dataclass(frozen=True)
class SharedEquations:
    """What a part leaves of its normal equations for the n unknowns that it shares, when its own are eliminated."""

    number: Int
    """(n,) int64. What the unknowns are called in all parts."""
    N: Float
    """(n (n + 1) / 2,). Lower triangle, column by column."""
    g: Float
    diagonal: Float
    """(n,) both. Gradient; diagonal of A'A before the elimination."""
    cost: float
    decrease: float
    damping: float
    regular: bool
    """Whether the part's own unknowns are determined."""


@dataclass(frozen=True)
class JointSolution:
    """What all parts together give."""

    x: Float
    """(n,). Solution of the part's shared unknowns."""
    diagonal: Float
    """(n,). Diagonal of A'A of all parts before the elimination."""
    cost: float
    decrease: float
    counted_twice: float
    """x' diag(A'A) x of the shared unknowns, as often as they are in more parts than one."""
    covariance: Float | None = None
    """(n, n). Of the part's shared unknowns, where it was asked for."""


class Others(Protocol):
    """All parts of a problem, as seen by one."""

    def joined(self, equations: SharedEquations) -> JointSolution:
        """The joint solution.

        Raises
        ------
        NotInParts
            If unknowns are not determined.
        """

    def shared_covariance(self) -> Float:
        """Covariance of the part's shared unknowns from all parts, (n, n), at the last joint solution."""

    def total(self, value: float) -> float:
        """The sum over all parts."""

    def largest(self, value: float) -> float:
        """The largest value of a part."""

    def first(self, text: str) -> str:
        """The first text that is not empty."""
