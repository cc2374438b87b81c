"""A factorised linearisation, and the factor of its reduced normal equations.

A direct factor holds L, front by front: solutions of any right-hand side, covariances and null vectors follow from it.
Conjugate gradients leave nothing but the solution of the one right-hand side they were asked for. Whoever needs more
asks `is_direct` first, or asks for a panel and is refused.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from aatri.adjustment.elimination.panels import Panels, down_the_tree
from aatri.adjustment.others import JointSolution
from aatri.adjustment.structure.tree import Tree
from aatri.arrays import Float
from aatri.errors import ResourceError

LOST = 1e-13
"""Pivot, as a share of its diagonal, that is lost in rounding: a sum of n squares errs by some sqrt(n) times 1e-16 of
it (Higham, Accuracy and Stability of Numerical Algorithms, 4.2 and 10.1), so that 1e-13 is right to sqrt(n) / 1000: to
1 % at a hundred records of an unknown, to 10 % at ten thousand."""


@dataclass(frozen=True)
class Factor:
    """What a linearisation was solved with: L of the whole matrix, or the solution alone."""

    panels: Panels | None = None
    """Panels of (n, m) float64. L11 and L21 of each node."""
    x: Float | None = None
    """(n_kept,). The solution that conjugate gradients have reached."""

    @property
    def is_direct(self) -> bool:
        """Whether panels can be asked for: covariances, other right-hand sides, null vectors."""
        return self.panels is not None

    def panel(self, k: int) -> Float:
        """L11 and L21 of a node, (n, m).

        Raises
        ------
        ResourceError
            If there is no factor.
        """
        return self.all_panels[k]

    @property
    def all_panels(self) -> Panels:
        """Those of all nodes, as `panel`."""
        if self.panels is None:
            raise without_factor()
        assert not self.is_cleared, "the factor has been given back"
        return self.panels

    def solution(self, tree: Tree, y: Sequence[Float], n_kept: int) -> Float:
        """Solution of the reduced normal equations, (n_kept,), whose forward-substituted right-hand side is y."""
        if self.x is not None:
            return self.x
        x = forward_substituted(tree, y, n_kept)
        down_the_tree(tree, self.all_panels, x[:, None])
        return x

    def release(self, k: int) -> None:
        """Give back the memory of a node's panel, which cannot be asked for any more."""
        if self.panels is not None:
            self.panels.release(k)

    def clear(self) -> None:
        """Give back the room; nothing can be asked any more."""
        if self.panels is not None:
            self.panels.clear()

    @property
    def is_cleared(self) -> bool:
        """Whether its file has been given back."""
        return self.panels is not None and self.panels.closed


@dataclass
class Factored:
    """A factorised linearisation."""

    factor: Factor
    """Of the reduced normal equations, whole or not."""
    y: list[Float]
    """List of (m,). Forward-substituted gradient of each node."""
    block_factor: Float
    block_y: Float
    """(n_blocks, 6), (n_blocks, 3)."""
    determined: Float
    """(n_blocks,). 0 where an eliminated block is not determined."""
    diagonal: Float
    """(n_kept,). Diagonal of A'A."""
    weak: list[tuple[int, int]]
    """List of (node, row). First pivot of each front that is below the rank tolerance."""
    lost: bool
    """A pivot is lost in rounding, or not positive."""
    cost: float
    damping: float
    multiplier: Float = field(default_factory=lambda: np.zeros(0))
    violation: Float = field(default_factory=lambda: np.zeros(0))
    """(m,). Of the constraints, if any."""
    is_chord: bool = False
    """The factor is that of an earlier state; see `stepping.chord`."""
    joint: JointSolution | None = None
    root: tuple[Float, Float, Float] | None = None
    """Of a part: what all parts together give, `cost` is theirs; front of its root with gradient and diagonal."""

    def clear(self) -> None:
        """Give back the room of the factor, and of the front of a part's root."""
        self.factor.clear()
        self.root = None

    @property
    def decrease(self) -> float:
        """Decrease of the cost by the linear model but for the damping: the Newton decrement squared."""
        if self.joint is not None:
            return self.joint.decrease
        return float(sum(y @ y for y in self.y) + (self.block_y**2).sum())


def forward_substituted(tree: Tree, y: Sequence[Float], n_kept: int) -> Float:
    """The parts of the nodes in one vector, (n_kept,)."""
    x = np.zeros(n_kept)
    for node, part in zip(tree.nodes, y):
        x[node.columns[: node.panel]] = part
    return x


def without_factor(size: str = "") -> ResourceError:
    """The error of asking for what only a direct factor gives."""
    return ResourceError(
        f"exact covariances need the factor of the normal equations{size}, and this block is solved by conjugate "
        "gradients, without it",
        remedy="raise memory_gb, or give more disk to TMPDIR",
    )
