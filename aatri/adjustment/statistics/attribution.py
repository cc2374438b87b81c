"""Which of the records of a block are wrong, and whether that can be told: the least that has to go.

A block (a ground point) is determined by its own records (rays, control), everything else held. With whitened residuals
v_i and Jacobians B_i of the records kept,

    x = -N^-1 sum B_i'v_i,  N = sum B_i'B_i,    e_i = v_i + B_i x,    R_i = I - B_i N^-1 B_i',    w = e / sqrt(diag R)

they agree if no |w| is above the limit. Where they do not, the fewest records are sought without which the others
agree: one, two, else the one that makes the others agree best, and again. What is demanded exact (`firm`) goes only
where else two would have to. By likelihood the best choice leaves the
least e'e. Another choice that agrees too, and costs no more than `SEPARABLE` above it, cannot be told from it: the
records of both are named, and nobody is blamed. Correlation 1 of two tests, as of the two rays of a point, is the case
where both cost the same; on one line of flight an error along it belongs to any of three rays.

Source: Foerstner 1983, Reliability and discernability of extended Gauss-Markov models; docs/formulas.md 7.3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from aatri.adjustment.statistics.limits import CONTROLLED_COMPONENT, MOST_FOR_PAIRS, SEPARABLE
from aatri.arrays import Bool, Float, Int

Choice = tuple[tuple[int, ...], Bool]
"""Records to leave out, and the blocks where they may be, (n,)."""


@dataclass(frozen=True)
class BlockRecords:
    """The records of some blocks, padded to the same number."""

    v: Float
    """(n, k, m). Whitened residuals; zero where there is no component."""
    B: Float
    """(n, k, m, 3). Their derivatives by the block."""
    present: Bool
    """(n, k)."""
    firm: Bool
    """(n, k). Demanded exact: to leave it out counts as two."""
    limit: Float
    """(n, k). |w| up to which a record agrees."""

    def of(self, blocks: Int | Bool, most: int | None = None) -> BlockRecords:
        """Some of the blocks, of no more than `most` records each."""
        part = np.s_[blocks, :most]
        return BlockRecords(self.v[part], self.B[part], self.present[part], self.firm[part], self.limit[part])


@dataclass(frozen=True)
class Explanation:
    """What is wrong in each block."""

    out: Bool
    """(n, k). Records to leave out."""
    undecided: Bool
    """(n, k). Those of them of which only some are wrong, and nothing tells which."""
    single: Bool
    """(n,). To leave out one record is enough."""
    step: Float
    """(n, 3). What the others move the block by."""
    gain: Float
    """(n,). Fall of e'e by leaving them out."""


def explain(records: BlockRecords, suspected: Bool) -> Explanation:
    """Find what is wrong in each block; blocks of about as many records are looked at together.

    Parameters
    ----------
    suspected : (n,) bool
        Blocks in which at least one record is wrong, as a stricter test has shown.
    """
    n, k = records.present.shape
    out, undecided, single = np.zeros((n, k), bool), np.zeros((n, k), bool), np.zeros(n, bool)
    step, gain = np.zeros((n, 3)), np.zeros(n)
    last = (records.present * np.arange(1, k + 1)).max(axis=1, initial=1)
    width = np.minimum(2 ** np.ceil(np.log2(last)).astype(np.int64), k)
    for most in np.unique(width).tolist():
        blocks = np.flatnonzero(width == most)
        part = _explained(records.of(blocks, most), suspected[blocks])
        out[blocks, :most], undecided[blocks, :most], single[blocks] = part.out, part.undecided, part.single
        step[blocks], gain[blocks] = part.step, part.gain
    return Explanation(out, undecided, single, step, gain)


def _explained(records: BlockRecords, suspected: Bool) -> Explanation:
    n, k = records.present.shape
    cost_before, largest, _ = _agreement(records, records.present)
    keep, undecided, single = records.present.copy(), np.zeros((n, k), dtype=bool), np.zeros(n, dtype=bool)
    todo = np.flatnonzero(suspected | (largest > 1.0))
    while len(todo):
        unexplained, kept = records.of(todo), keep[todo]
        out, unclear = _least(unexplained, kept, [((j,), kept[:, j] & ~unexplained.firm[:, j]) for j in range(k)])
        missing = np.flatnonzero(~out.any(axis=1))
        single[todo] = out.any(axis=1) & (keep[todo] == records.present[todo]).all(axis=1)
        if len(missing):
            few, left = unexplained.of(missing), kept[missing]
            free = left & ~few.firm & (left.sum(axis=1) <= MOST_FOR_PAIRS)[:, None]
            choices: list[Choice] = [
                ((i, j), free[:, i] & free[:, j]) for i, j in combinations(np.flatnonzero(free.any(axis=0)).tolist(), 2)
            ]
            choices += [((j,), left[:, j] & few.firm[:, j]) for j in range(k)]
            out[missing], unclear[missing] = _least(few, left, choices)
        keep[todo] &= ~out
        undecided[todo] |= unclear
        open_ = np.flatnonzero(~out.any(axis=1) & ((kept & ~unexplained.firm).sum(axis=1) > 1))
        if len(open_):
            keep[todo[open_], np.argmin(_without_each(unexplained.of(open_), kept[open_]), axis=1)] = False
        todo = todo[open_]
    cost, _, step = _agreement(records, keep)
    return Explanation(records.present & ~keep, undecided, single, step, cost_before - cost)


def _least(records: BlockRecords, kept: Bool, choices: Sequence[Choice]) -> tuple[Bool, Bool]:
    """What to leave out where one of the choices is enough, and what of it is undecided; (n, k) each."""
    n, k = kept.shape
    cost = np.full((n, len(choices)), np.inf)
    for j, (choice, may) in enumerate(choices):
        there = np.flatnonzero(may)
        if len(there):
            less = kept[there].copy()
            less[:, choice] = False
            value, largest, _ = _agreement(records.of(there), less)
            cost[there, j] = np.where(largest <= 1.0, value, np.inf)
    near = np.isfinite(cost) & (cost <= cost.min(axis=1, initial=np.inf)[:, None] + SEPARABLE)
    member = np.zeros((len(choices), k), dtype=np.float32)
    for j, (choice, _) in enumerate(choices):
        member[j, choice] = 1.0
    count = near.astype(np.float32) @ member  # choices, of those that are as good as the best, that leave a record out
    named = count > 0
    return named, named & (count < near.sum(axis=1)[:, None])


def _without_each(records: BlockRecords, kept: Bool) -> Float:
    """e'e of the others, without each record in turn, (n, k); infinite where it is firm or not kept."""
    cost = np.full(kept.shape, np.inf)
    for j in range(kept.shape[1]):
        there = np.flatnonzero(kept[:, j] & ~records.firm[:, j])
        if len(there):
            less = kept[there].copy()
            less[:, j] = False
            cost[there, j], _, _ = _agreement(records.of(there), less)
    return cost


def _agreement(records: BlockRecords, kept: Bool) -> tuple[Float, Float, Float]:
    """e'e (n,), largest |w| over its limit (n,) and x (n, 3) of the records kept."""
    B = np.where(kept[:, :, None, None], records.B, 0.0)
    v = np.where(kept[:, :, None], records.v, 0.0)
    N = np.einsum("nkmi,nkmj->nij", B, B)
    size = np.einsum("nii->n", N)
    inverse = np.linalg.pinv(N / np.where(size > 0, size, 1.0)[:, None, None], rcond=1e-11, hermitian=True)
    inverse /= np.where(size > 0, size, 1.0)[:, None, None]
    x = -np.einsum("nij,nkmj,nkm->ni", inverse, B, v)
    e = v + np.einsum("nkmi,ni->nkm", B, x)
    r = 1.0 - np.einsum("nkmi,nij,nkmj->nkm", B, inverse, B)
    tested = kept[:, :, None] & (r > CONTROLLED_COMPONENT)
    w = np.where(tested, np.abs(e) / np.sqrt(np.where(tested, r, 1.0)), 0.0) / records.limit[:, :, None]
    return np.einsum("nkm,nkm->n", e, e), w.max(axis=(1, 2), initial=0.0), x
