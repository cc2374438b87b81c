"""Relative control of two blocks: equal conditions count once, those that state other values are conflicts."""

from typing import Any

import numpy as np

from aatri.artifacts.block import Block, RelativeControl, RelativeControlMembers
from aatri.formats.merging.reconciliation import Reconciliation
from aatri.formats.merging.rows import SAME
from aatri.ids import shown

Key = tuple[str, str, tuple[tuple[str, str], ...]]
"""Type, axis and members of a condition."""


def merged_conditions(a: Block, b: Block, rules: Reconciliation) -> tuple[RelativeControl, RelativeControlMembers]:
    """The conditions of both blocks, in canonical order."""
    first = {key: k for k, key in enumerate(conditions_of(a))}
    fresh, keys = [], conditions_of(b)
    for k, key in enumerate(keys):
        if key not in first:
            fresh.append(k)
            continue
        rows = a.relative_control, b.relative_control
        values = [(float(r.value[i]), float(r.sigma[i])) for r, i in zip(rows, (first[key], k))]
        if not np.allclose(values[0], values[1], rtol=SAME, atol=0.0, equal_nan=True):
            called = f"{key[0]} of {shown([name for _, name in key[2]])}: value and sigma"
            rules.conflict(called, [np.array(v) for v in values], b.read_at(b.relative_control, k))
    other = b.relative_control.take(np.array(fresh, dtype=np.intp))
    other = RelativeControl.of(
        **{
            **{name: getattr(other, name) for name in ("type", "value", "sigma", "axis", "line")},
            "file": np.where(other.file >= 0, other.file + len(a.files), -1),
        }
    )
    return conditions_in_order(a.relative_control.followed_by(other), [*first, *(keys[k] for k in fresh)])


def conditions_of(block: Block) -> list[Key]:
    """What identifies each condition of a block."""
    rows, members = block.relative_control, block.relative_control_members
    listed: list[list[tuple[str, str]]] = [[] for _ in range(len(rows))]
    for k, part, name in zip(members.condition.tolist(), members.part.tolist(), members.id.tolist()):
        listed[k].append((part, name))
    return [(t, x, tuple(m)) for t, x, m in zip(rows.type.tolist(), rows.axis.tolist(), listed)]


def conditions_in_order(rows: RelativeControl, keys: list[Key]) -> tuple[RelativeControl, RelativeControlMembers]:
    """Conditions in canonical order, and the table of their members."""

    def order(k: int) -> Any:
        kind, axis, members = keys[k]
        named = tuple((part.encode(), name.encode()) for part, name in members)
        return kind, axis, named, float(np.nan_to_num(rows.value[k], nan=-1.0)), float(rows.sigma[k])

    chosen = sorted(range(len(keys)), key=order)
    listed = [(row, part, name) for row, k in enumerate(chosen) for part, name in keys[k][2]]
    return rows.take(np.array(chosen, dtype=np.intp)), RelativeControlMembers.of(
        condition=[m[0] for m in listed], part=[m[1] for m in listed], id=[m[2] for m in listed]
    )
