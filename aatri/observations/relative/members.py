"""The conditions of relative_control.yaml: their members, points or projection centres, and unknowns of their own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from aatri.adjustment.records import Evaluate, Evaluated, Records
from aatri.adjustment.unknowns import State, Unknowns, add_step
from aatri.arrays import Bool, Float, Int, Text, sums_of
from aatri.ids import rows_of, several, shown
from aatri.notes import Note
from aatri.observations.geodetic.sights import ALL, Sights, inverse_sigmas, rows_of_ends
from aatri.observations.observed import ObservationSource, Observed, named
from aatri.observations.poses import POINT

if TYPE_CHECKING:
    from aatri.artifacts.block import Block

MOST_NAMED = 6


def by_exactness(block: Block, type_: str) -> Iterator[tuple[Int, bool]]:
    """Rows of relative_control of a type, observed and exact ones apart, and whether they are exact."""
    control = block.relative_control
    for exact in (False, True):
        row = np.flatnonzero((control.type == type_) & ((control.sigma == 0) == exact))
        if len(row):
            yield row, exact


def members_of(block: Block, row: int) -> tuple[Int, Text]:
    """Members of a condition in their order: rows in points or images, and their ids."""
    m = block.relative_control_members
    of_condition = m.condition == row
    kind = np.where(m.part[of_condition] == "images", "image", "point")
    return rows_of_ends(block, m.id[of_condition], kind), m.id[of_condition]


def pairs_as_sights(block: Block, type_: str) -> Sights:
    """Conditions between two members as sights from the first to the second."""
    control, members = block.relative_control, block.relative_control_members
    row = np.flatnonzero(control.type == type_)
    first = np.searchsorted(members.condition, row)
    image = members.part[first] == "images"
    ends = [members.id[first + k] for k in range(2)]
    at, to = (np.where(image, rows_of(ids, block.images.id), rows_of(ids, block.points.id)) for ids in ends)
    zero, empty = np.zeros(len(row)), np.full(len(row), "")
    names = np.array([f"{a}-{b}" for a, b in zip(*ends)], dtype=np.str_)
    return Sights(
        row, at, to, image, image, zero, zero, control.value[row], control.sigma[row], names, empty, empty, empty
    )


@dataclass(frozen=True)
class Conditions:
    """Conditions of one type on points, each with unknowns of its own: a shape, a height, a length."""

    type: str
    """Name of the kind, too."""
    exact: bool
    row: Int
    """(n,). In relative_control."""
    point: Int
    """(m, k) int32. The points of each record."""
    of: Int
    """(m,) int32. Condition of each record."""
    names: Text
    """(m,) str."""
    member: Int
    """(m,). Row of each record in relative_control_members."""
    labels: Text
    """(n,) str. What messages call the conditions."""
    sigma: Float
    """(m,)."""

    @property
    def group(self) -> str:
        """Name of the group of unknowns."""
        return f"exact_{self.type}" if self.exact else self.type

    def observed(
        self,
        evaluate: Evaluate,
        start: Float,
        labels: tuple[str, ...],
        generator: Callable[[State], Float],
        similarity: Evaluated,
        *,
        rows: int = 1,
        free: Bool | None = None,
        implausible: Float | None = None,
        sees: tuple[bool, bool, bool] = ALL,
    ) -> Observed:
        """The conditions as observations.

        Parameters
        ----------
        evaluate : callable
            v, and its derivatives by the points and by the unknowns of the condition.
        start : (n, s) float64
        labels : tuple of str
            Of the s unknowns.
        generator, similarity, implausible, free
            See `Unknowns` and `Records`; all unknowns are free unless stated.
        sees
            See `Observed`.
        rows : int
            Residuals of a record.
        """
        free = np.ones(start.shape, dtype=bool) if free is None else free
        touches = (*((POINT, column) for column in self.point.T), (self.group, self.of))
        used = np.ones(len(self.of), dtype=bool)
        records = Records(self.type, touches, evaluate, inverse_sigmas(self.sigma, rows), used, similarity=similarity)
        unknowns = Unknowns(
            self.group, free, labels, self.labels, add_step, generator=generator, implausible=implausible
        )
        gained, status = rows * len(self.of) - int(free.sum()), "exact" if self.exact else "observed"
        text = f"{self.type}: {several(len(self.row), 'condition')} {status}, redundancy gained {gained}"
        return Observed(
            records,
            self.member,
            named(point=self.names),
            "m",
            unknowns=(unknowns,),
            start={self.group: start},
            exact=self.exact,
            sees=sees,
            notes=(Note("note", text, tuple(self.labels.tolist())),),
        )


def observed_conditions(
    source: ObservationSource,
    type_: str,
    observe: Callable[[ObservationSource, Conditions], Observed],
    at_once: int = 1,
) -> Iterator[Observed]:
    """The conditions of a type, observed and exact ones apart.

    Parameters
    ----------
    at_once : int
        Points of a record.
    """
    block = source.block
    for row, exact in by_exactness(block, type_):
        members = [members_of(block, int(k)) for k in row]
        point, ids = (np.concatenate(part).reshape(-1, at_once) for part in zip(*members))
        condition = np.repeat(np.arange(len(row)), [len(m[0]) // at_once for m in members]).astype(np.int32)
        conditions = Conditions(
            type_,
            exact,
            row,
            point.astype(np.int32),
            condition,
            np.array(["-".join(names) for names in ids], dtype=np.str_),
            np.flatnonzero(np.isin(block.relative_control_members.condition, row))[::at_once],
            np.array([shown(m[1].tolist(), MOST_NAMED) for m in members], dtype=np.str_),
            block.relative_control.sigma[row][condition],
        )
        yield _refitting(source, conditions, observe)


def _refitting(
    source: ObservationSource, conditions: Conditions, observe: Callable[[ObservationSource, Conditions], Observed]
) -> Observed:
    return replace(
        observe(source, conditions),
        refitted=lambda start: _refitting(replace(source, start=start), conditions, observe),
    )


def means(values: Float, of: Int, n: int) -> Float:
    """Means of the rows of `values` (m, k) that belong to each of n, (n, k); zero of none."""
    count = np.maximum(np.bincount(of, minlength=n), 1)
    return sums_of(values, of, n) / count[:, None]
