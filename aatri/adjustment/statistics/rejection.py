"""Which records to reject, and which to take back: the rules of data snooping, for records of any kinds.

Gross errors hide each other and show in good neighbours, so that of all records above the limit only the clearest are
rejected before the next adjustment: at most one per block of the `neighbourhood` (a point is one), none with less than
`clear` of the largest test, and of all at most `most`. Of two records of a block that share one test the one that does
not touch the `share` group (control) is named before one that does, the less precise before the other.

No more of the records of a block of the `share` group (a strip), or of a kind that does not touch it, is rejected in
all than there is `room` for (`Pool.room`, else a share of them): where more disagrees the model is wrong, not the data.
The last record that ties a block of the neighbourhood to the `share` group stays, for the others of that block would be
tested by nothing; and a record without a test is never rejected for it (`stranded`).

A kind of n records has the redundancy R = sum tr(R_i) / m_i, counted in records. R - g of them are left to test the
others when g are out. Up to half of R may go; of a small kind three may, as long as R allows it: thirteen control
points in a block of strong rays have R = 10 and room for five, six have R = 3.7 and room for three. One may go wherever
anything is tested at all: control that is far better than the rays has next to no redundancy, and its tests, which know
that, tell all the same; whether it is the right one shows as each is left out (`leave_one_out`). Where more contradict
the rest, single gross errors explain nothing: the kind is named, and all of it stays, never a part (`overfull`).

Source: Rousseeuw and Leroy 1987 (half is the most that a fit can bear); Foerstner 1979 (redundancy of groups).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.statistics.limits import SMALL_ROOM, TESTED_REDUNDANCY
from aatri.arrays import Bool, Float, Int


@dataclass(frozen=True)
class Snooping:
    """Rules of data snooping."""

    limit: float
    """Test statistic above which a record is rejected."""
    neighbourhood: tuple[str, ...] = ("point",)
    """Groups of unknowns: at most one rejection per block and round."""
    share: tuple[str, float] = ("strip", 0.15)
    """(str, float). A group of unknowns, and the largest share of a block's records that is rejected."""
    clear: float = 0.5
    """Least test of a rejection, as a share of the largest; infinite: none is rejected."""
    most: float = 0.01
    """Most rejections of a round, as a share of all records; at least one."""


@dataclass(frozen=True)
class Pool:
    """All records of an adjustment, kind after kind."""

    neighbours: Int
    """(n, groups) int32. Block of each group of the neighbourhood; -1 where it is not touched."""
    source: Int
    """(n,) int32. What the share is counted over: a block of the share's group, or a kind."""
    carrier: Bool
    """(n,). Records that touch the share's group."""
    counted: Bool
    """(n,). Records that have a neighbour: the others are tested by nothing."""
    variance: Float
    """(n,). Trace of the covariance."""
    room: Int | None = None
    """(sources,) int64. How many may be rejected of each source; default: by the share of the rule."""


def pool_of(snooping: Snooping, records: Sequence[Records], variances: Sequence[Float]) -> Pool:
    """Put records together for the rules; `variances` are the traces of their covariances, kind by kind."""
    neighbours, source, carrier = [], [], []
    kinds = len(records)
    for kind, r in enumerate(records):
        touched = dict(r.touches)
        n = len(r.active)
        none = np.full(n, -1, dtype=np.int32)
        neighbours.append(np.stack([touched.get(group, none) for group in snooping.neighbourhood], axis=1))
        owner = touched.get(snooping.share[0])
        carrier.append(np.full(n, owner is not None))
        source.append(np.full(n, kind, dtype=np.int32) if owner is None else kinds + owner.astype(np.int32))
    near = np.concatenate(neighbours).astype(np.int32, copy=False)
    counted = np.zeros(len(near), dtype=bool)
    for block in near.T:
        counted |= (block >= 0) & (np.bincount(np.maximum(block, 0), block >= 0)[np.maximum(block, 0)] > 1)
    return Pool(near, np.concatenate(source), np.concatenate(carrier), counted, np.concatenate(variances))


def clearest(snooping: Snooping, pool: Pool, test: Float, active: Bool, controlled: Bool | None = None) -> Bool:
    """The clearest gross errors among the active records, (n,) bool; none of records that are not `controlled`."""
    wrong = np.zeros(len(test), dtype=bool)
    candidates = np.flatnonzero(active & (test > snooping.limit) & (True if controlled is None else controlled))
    if not len(candidates):
        return wrong
    keys = (-pool.variance[candidates], pool.carrier[candidates], -np.round(test[candidates], 6))
    order = candidates[np.lexsort(keys)]
    order = order[test[order] >= snooping.clear * test[order[0]]]
    room = room_left(snooping, pool, active)
    ties = [_carriers(pool, block, active) for block in pool.neighbours.T]
    most = max(1, int(snooping.most * len(test) + 1e-9))
    neighbours: list[set[int]] = [set() for _ in snooping.neighbourhood]
    for k in order:
        near = pool.neighbours[k].tolist()
        met = any(b in seen for b, seen in zip(near, neighbours))
        last = pool.carrier[k] and any(b >= 0 and count[b] < 2 for b, count in zip(near, ties))
        if met or last or room[pool.source[k]] <= 0:
            continue
        wrong[k] = True
        room[pool.source[k]] -= 1
        for b, seen in zip(near, neighbours):
            if b >= 0:
                seen.add(b)
        if wrong.sum() >= most:
            break
    return wrong


def fitting(snooping: Snooping, test: Float, active: Bool) -> Bool:
    """Rejected records whose prediction fits after all, (n,) bool."""
    return np.asarray(~active & (test < snooping.limit))


def stranded(pool: Pool, test: Float, active: Bool) -> Bool:
    """Rejected records without a test, whose block nothing ties any more: the most precise tie of each, (n,) bool."""
    is_stranded = np.zeros(len(test), dtype=bool)
    for block in pool.neighbours.T:
        rows = np.flatnonzero(~active & ~np.isfinite(test) & pool.carrier & (block >= 0))
        rows = rows[_carriers(pool, block, active)[block[rows]] == 0]
        rows = rows[np.lexsort((pool.variance[rows], block[rows]))]
        is_stranded[rows[np.diff(block[rows], prepend=-1) > 0]] = True
    return is_stranded


def _carriers(pool: Pool, block: Int, active: Bool) -> Float:
    """Active records that tie each block of the neighbourhood to the share's group."""
    tied = active & pool.carrier & (block >= 0)
    return np.bincount(block[tied], minlength=int(block.max(initial=0)) + 1).astype(np.float64)


def room_left(snooping: Snooping, pool: Pool, active: Bool) -> Int:
    """How many more records of each source may be rejected, (sources,)."""
    n = int(pool.source.max(initial=-1)) + 1 if pool.room is None else len(pool.room)
    room = pool.room
    if room is None:
        room = np.ceil(snooping.share[1] * np.bincount(pool.source[pool.counted], minlength=n)).astype(np.int64)
    return np.asarray(room - np.bincount(pool.source[~active & pool.counted], minlength=n))


def overfull(snooping: Snooping, pool: Pool, above: Bool, active: Bool, began: Bool) -> tuple[Bool, Bool]:
    """Sources of which more disagrees than there is room for, (sources,); what is to come back of them, all, (n,).

    Parameters
    ----------
    above : (n,) bool
        Records beyond the limit though no more of theirs may go.
    active, began : (n,) bool
        Records in use, and those of the beginning.
    """
    left = room_left(snooping, pool, active)
    full = (left <= 0) & (np.bincount(pool.source[above & active], minlength=len(left)) > 0)
    back = full[pool.source] & began & ~active
    return full & (np.bincount(pool.source[back], minlength=len(left)) > 0), back


def room_of(redundancy: Float, count: Int, max_share: float | None = None) -> Int:
    """How many records of each kind may be rejected.

    Parameters
    ----------
    redundancy : (g,) float64
        Of each kind, in records.
    count : (g,) int
        Its records.
    max_share : float, optional
        This share of a kind instead, where the user says so.

    Returns
    -------
    (g,) int
    """
    half, upper = np.floor(0.5 * redundancy), np.maximum(np.floor(redundancy + 1e-9), redundancy > TESTED_REDUNDANCY)
    room = np.minimum(np.maximum(half, SMALL_ROOM), upper).astype(np.int64)
    return room if max_share is None else np.ceil(max_share * count).astype(np.int64)


def redundancy_in_records(redundancy: Float, components: Float | Int) -> float:
    """R of a kind: sum of tr(R_i) / m_i.

    Parameters
    ----------
    redundancy : (n,) float64
        tr(R_i) of each record; NaN counts as none.
    components : (n,)
        m_i, the components observed.
    """
    share = np.where((components > 0) & np.isfinite(redundancy), redundancy / np.maximum(components, 1), 0.0)
    return float(share.sum())
