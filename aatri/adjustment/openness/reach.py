"""Observations so accurate beside all others that double precision cannot hold both: weights are brought within reach.

The squares of an observation's derivatives by the unknowns it touches are what it adds to the normal matrix. Where it
adds more than BEYOND times what all less accurate ones together add, what those say is lost in the rounding of the sum.
Such an observation gets the weight that adds WITHIN times as much: its standard deviation is larger, and still a ten
thousandth of what would be felt. Where accurate observations are enough to determine a block alone there is nothing to
lose. Only observations between blocks are changed; that of one block does no harm.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from aatri.adjustment.openness.limits import BEYOND, WITHIN
from aatri.adjustment.records import Records, whitened
from aatri.adjustment.unknowns import State
from aatri.arrays import Float, Int


def within_reach(records: Sequence[Records], candidates: Sequence[int], state: State) -> dict[int, Float]:
    """By how much the whiteners of records are to be multiplied, (n,), for those candidates that are beyond reach.

    Parameters
    ----------
    candidates : sequence of int
        Places of those whose weight may be brought within reach.
    state : mapping
        Where the derivatives are formed.
    """
    touched: dict[str, list[Int]] = {}
    for i in candidates:
        for group, block in records[i].touches:
            touched.setdefault(group, []).append(block[records[i].active])
    blocks_of = {group: np.unique(np.concatenate(blocks)) for group, blocks in touched.items()}
    pieces: dict[str, list[tuple[Int, Float, Int, Int, int, int]]] = {group: [] for group in blocks_of}
    for i, r in enumerate(records):
        near = np.zeros(len(r.active), dtype=bool)
        for group, block in r.touches:
            if group in blocks_of:
                near |= np.isin(block, blocks_of[group])
        rows = np.flatnonzero(near & r.active)
        if not len(rows):
            continue
        _, jacobians = whitened(r, state, rows)
        for (group, block), J in zip(r.touches, jacobians):
            if group in blocks_of:
                size = (J**2).sum(axis=2).max(axis=1)
                pieces[group].append((block[rows], size, np.full(len(rows), i), rows, r.rows, J.shape[2]))
    factor = {i: np.ones(len(records[i].active)) for i in candidates}
    for parts in (p for p in pieces.values() if p):  # none of a group whose candidates are all inactive
        block, size, of, row = (np.concatenate([part[k] for part in parts]) for k in range(4))
        residuals = np.concatenate([np.full(len(part[0]), part[4]) for part in parts])
        _bring(block, size, of, row, residuals, parts[0][5], factor)
    return {i: f for i, f in factor.items() if (f < 1).any()}


def _bring(block: Int, size: Float, of: Int, row: Int, residuals: Int, scalars: int, factor: dict[int, Float]) -> None:
    """Lower the factors of what is beyond reach at some blocks of one group, by what observations add to them."""
    usable = np.flatnonzero(np.isfinite(size) & (size > 0))
    order = usable[np.lexsort((size[usable], block[usable]))]
    size, (block, of, row, residuals) = size[order], (part[order] for part in (block, of, row, residuals))
    if not len(block):
        return
    new = np.concatenate([[True], block[1:] != block[:-1]])
    number = np.cumsum(new) - 1
    below = _sums_within(size, new)
    from_here = _sums_within(residuals[::-1].astype(float), np.append(new[1:], True)[::-1])[::-1]
    enough = from_here + residuals >= scalars
    gap = (below > 0) & (size > BEYOND * below) & ~enough
    limit = np.full(int(number[-1]) + 1, np.inf)
    limit[number[gap]] = WITHIN * below[gap]  # of several gaps the last
    share = np.sqrt(np.minimum(limit[number] / size, 1.0))
    for i, f in factor.items():
        lowered = (of == i) & (share < 1)
        np.minimum.at(f, row[lowered], share[lowered])


def _sums_within(size: Float, new: np.ndarray) -> Float:
    """Sum of those before each in its block: block by block, so that no large one of another block is added."""
    sums = np.zeros(len(size))
    starts = np.append(np.flatnonzero(new), len(size))
    for a, z in pairwise(starts):
        sums[a + 1 : z] = np.cumsum(size[a : z - 1])
    return sums


def scaled(records: Records, factor: Float) -> Records:
    """The records with their whiteners multiplied row by row."""
    shape = (-1, *[1] * (records.whitener.ndim - 1))
    return replace(records, whitener=records.whitener * factor.reshape(shape))
