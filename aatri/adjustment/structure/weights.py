"""Rejection and reweighting: other numbers on the index of a problem, which does not change.

An inactive record contributes nothing and is predicted. A block of the eliminated group (a ground point) whose records
are all inactive takes no part: it is held, its step is zero, and neither it nor what touches it has a covariance. A
block of another group with inactive records only is not determined, and so is one that no record touches at all.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aatri.adjustment.records import Records, keys_of
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.structure.layout import with_fixed
from aatri.adjustment.unknowns import Unknowns
from aatri.arrays import Bool, Float


@dataclass(frozen=True)
class Weights:
    """What may change of the records of one observation type; None stays as it is."""

    active: Bool | None = None
    """(n,)."""
    whitener: Float | None = None
    """(n, m, m) or (n, m). Of the shape it had."""


def with_weights(problem: IndexedProblem, weights: Mapping[str, Weights]) -> IndexedProblem:
    """The problem with other weights of some observation types, by their keys (`records.keys_of`).

    Raises
    ------
    ValueError
        If a key is not that of an observation type, or an array has another shape than before.
    """
    of_key = dict(zip(keys_of(problem.observed), problem.observed))
    changed = {}
    for key, new in weights.items():
        if key not in of_key:
            raise ValueError(f"no observation type has the key {key}: there are {', '.join(of_key)}")
        changed[id(of_key[key])] = _weighted(of_key[key], new)
    return _in_order(with_parts_taken(with_records(problem, changed)), problem)


def _in_order(new: IndexedProblem, old: IndexedProblem) -> IndexedProblem:
    """The new problem, with the rays' whiteners in their order if they are those of the old one."""
    before, after = old.rays, new.rays
    same = before is not None and after is not None and after.records.whitener is before.records.whitener
    if same and "predicting_lane" in old.__dict__:
        new.__dict__.setdefault("predicting_lane", old.predicting_lane)
    return new


def with_records(problem: IndexedProblem, changed: Mapping[int, Records]) -> IndexedProblem:
    """The problem with some records in the place of others, by `id` of the old; nothing is indexed anew."""
    rays = problem.rays
    return replace(
        problem,
        records=tuple(changed.get(id(r), r) for r in problem.records),
        rays=None if rays is None else replace(rays, records=changed.get(id(rays.records), rays.records)),
        kept=tuple(replace(k, records=changed.get(id(k.records), k.records)) for k in problem.kept),
        direct=tuple((changed.get(id(r), r), rows, blocks) for r, rows, blocks in problem.direct),
    )


def with_parts_taken(problem: IndexedProblem) -> IndexedProblem:
    """The problem with those blocks held whose records are all inactive."""
    no_part = _unobserved(problem.stated.unknowns, problem.records)
    for name, more in problem.set_aside.items():
        no_part[name] = no_part[name] | more
    unknowns = tuple(
        replace(u, free=u.free & ~no_part[u.name][:, None]) if no_part[u.name].any() else u
        for u in problem.stated.unknowns
    )
    if all(new is old for new, old in zip(unknowns, problem.unknowns)):
        return problem
    free = problem.block_free
    for u in unknowns:
        if u.eliminated and problem.rays is not None:
            free = np.ascontiguousarray(u.free[problem.rays.block], dtype=np.float64)
    return replace(problem, unknowns=unknowns, layout=with_fixed(problem.layout, unknowns), block_free=free)


def with_set_aside(problem: IndexedProblem, blocks: Mapping[str, Bool]) -> IndexedProblem:
    """The problem with some blocks held, and all records inactive that touch them."""
    set_aside = dict(problem.set_aside)
    for name, out in blocks.items():
        set_aside[name] = set_aside[name] | out if name in set_aside else out
    changed = {}
    for r in problem.records:
        touching = np.zeros(len(r.active), dtype=bool)
        for group, number in r.touches:
            if group in blocks:
                touching |= blocks[group][number]
        if (touching & r.active).any():
            changed[id(r)] = replace(r, active=r.active & ~touching)
    return with_parts_taken(replace(with_records(problem, changed), set_aside=set_aside))


def taking_no_part(problem: IndexedProblem) -> dict[str, Bool]:
    """Blocks with free scalars that are held: set aside, or none of their records is active; (n,) by group."""
    return {
        u.name: np.asarray((u.free & ~v.free).any(axis=1)) for u, v in zip(problem.stated.unknowns, problem.unknowns)
    }


def _unobserved(unknowns: Sequence[Unknowns], records: Sequence[Records]) -> dict[str, Bool]:
    """Blocks of the eliminated group that some record touches, but none that is active, (n,) by group."""
    unobserved = {u.name: np.zeros(len(u.free), dtype=bool) for u in unknowns}
    group = next((u.name for u in unknowns if u.eliminated), "")
    if not group or all(r.active.all() for r in records):
        return unobserved
    touched, active = unobserved[group].copy(), unobserved[group].copy()
    for r in records:
        for blocks in (b for g, b in r.touches if g == group):
            touched[blocks] = True
            active[blocks if r.active.all() else blocks[r.active]] = True
    unobserved[group] = touched & ~active
    return unobserved


def _weighted(records: Records, new: Weights) -> Records:
    active = records.active if new.active is None else new.active
    whitener = records.whitener if new.whitener is None else new.whitener
    if active.shape != records.active.shape or whitener.shape != records.whitener.shape:
        raise ValueError(f"weights of {records.name} of shape {active.shape} and {whitener.shape}")
    return replace(records, active=active, whitener=whitener)
