"""What is open, in words: the combinations of unknowns that a linearisation leaves without an answer."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from aatri.adjustment.openness.limits import NAMED
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.unknowns import Unknowns
from aatri.arrays import Float, Int
from aatri.errors import GeometryError
from aatri.ids import several, shown
from aatri.notes import Note

Move = Literal["scale", "tilt", "azimuth", "shift"]


def _none() -> Int:
    return np.zeros(0, dtype=np.int64)


@dataclass(frozen=True)
class OpenCombination:
    """A combination of unknowns that is open."""

    text: str
    """What messages call it."""
    moves: frozenset[Move] = frozenset()
    """What it does to a whole that it moves: shift, tilt (a rotation about a level axis), azimuth, scale; else empty.
    """
    of_whole: bool = False
    """Of the whole block; else of a part of it."""
    unknowns: tuple[tuple[str, str], ...] = ()
    """Labels and groups of the unknowns that are named."""
    counts: tuple[int, ...] = ()
    """Of how many blocks each of them takes part."""

    def __str__(self) -> str:
        return self.text


class OpenError(GeometryError):
    """Combinations of unknowns are open: `combinations` are those that the message names; `exact`: a pivot vanishes."""

    def __init__(
        self, what: str, *, remedy: str = "", combinations: Sequence[OpenCombination] = (), exact: bool = False
    ) -> None:
        self.combinations, self.exact = tuple(combinations), exact
        super().__init__(what, remedy=remedy)


@dataclass(frozen=True)
class OpenDirections:
    """What the observations leave open, or nearly so."""

    count: int
    """Open combinations of unknowns."""
    texts: tuple[OpenCombination, ...]
    """What they are; motions of the whole in one."""
    directions: Float
    """(n_kept, count). The combinations, in unknowns times the root of their diagonal."""
    vertices: Int = field(default_factory=_none)
    """(k,). Vertices that are open by themselves."""
    blocks: Int = field(default_factory=_none)
    """(k,). Eliminated blocks that are, by their place among the rays' blocks."""
    nearly: tuple[OpenCombination, ...] = ()
    """Combinations that are within a factor of ten of it."""
    exact: bool = False
    """A pivot vanishes; else rounding hides it."""
    more: int = 0
    """Directions without a text."""

    def refuse(self, before: str = "") -> None:
        """Raise if any combination is open; the message may begin with how it showed.

        Raises
        ------
        OpenError
        """
        if not self.texts:
            return
        more = f" and {self.more} more" if self.more else ""
        if self.exact:
            what = f"the observations leave {several(self.count, 'unknown')} open"
            remedy = ""
        else:
            what = f"the observations nearly leave {several(self.count, 'combination')} of unknowns open"
            remedy = "observe more, hold them or weigh them by a prior, or estimate fewer parameters"
        named = "; ".join(map(str, self.texts))
        is_exact = self.exact and not before  # of a block that has lost parts rounding proves nothing
        raise OpenError(f"{before}{what}: {named}{more}", remedy=remedy, combinations=self.texts, exact=is_exact)

    def notes(self) -> list[Note]:
        """Warnings of what is nearly open."""
        return [Note("warning", f"hardly determined by the observations: {text}") for text in self.nearly]


def described(problem: IndexedProblem, vector: Float) -> OpenCombination:
    """The unknowns that take part most in a null vector, group by group, of up to four blocks by name.

    A label takes part where one of its unknowns does, or all blocks together: what many blocks share, as the heights of
    all images where the principal distance is open, is small in each of them.
    """
    shares: list[tuple[float, float, Unknowns, int, list[int]]] = []
    for u in problem.unknowns:
        columns = problem.layout.columns(u.name, u.size)
        size = np.where(columns >= 0, np.abs(vector[np.maximum(columns, 0)]), 0.0)
        for scalar in range(u.size):
            own = size[:, scalar]
            total, most = float((own**2).sum()), float(own.max(initial=0.0))
            if total > 0:
                large = np.argsort(-own, kind="stable")[: int((own > NAMED * most).sum())].tolist()
                shares.append((total, most, u, scalar, large))
    shares.sort(key=lambda share: -share[0])
    largest = max((own for _, own, *_ in shares), default=0.0)
    members = [share for share in shares if share[0] > NAMED**2 * shares[0][0] or share[1] > NAMED * largest][:5]
    alike = list[list[tuple[Unknowns, int, list[int]]]]()
    for name in dict.fromkeys(u.name for _, _, u, *_ in members):
        for _, _, u, scalar, large in members:
            if u.name != name:
                continue
            same = (one for one in alike if one[0][0].name == name and any(set(large) & set(k) for *_, k in one))
            if (beside := next(same, None)) is None:
                alike.append(beside := [])
            beside.append((u, scalar, large))
    text = " with ".join(map(_of_blocks, alike))
    return OpenCombination(
        text or "unknowns of no group",
        unknowns=tuple((u.labels[scalar], u.name) for *_, u, scalar, _ in members),
        counts=tuple(len(large) for *_, large in members),
    )


def _of_blocks(members: Sequence[tuple[Unknowns, int, list[int]]]) -> str:
    """Labels of one group, and the blocks that have one of them at least: `rotation about X, X0 of image 7, 8`."""
    u = members[0][0]
    blocks = dict.fromkeys(k for *_, large in members for k in large)
    labels = ", ".join(u.labels[scalar] for _, scalar, _ in members)
    return f"{labels} of {u.name} {shown((str(u.ids[k]) for k in blocks), 4)}"
