"""Groups carried as unknowns, while single observations are tested: v + H p, p free, for each group.

Single observations are then tested against a model that has what is wrong with the group, and none is blamed in its
stead. Image points take p as a set of additional parameters, all other kinds as one more term.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State, Unknowns, add_step
from aatri.arrays import Float, Int
from aatri.observations.image_points import KIND as IMAGE_POINT
from aatri.observations.image_points import observed_image_points
from aatri.observations.observed import Observed
from aatri.observations.parameters import ParameterRows
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.groups.group import Group


def with_groups(block: BundleInput, groups: Sequence[Group], names: Sequence[str] = ()) -> BundleInput:
    """The block with what is wrong with some groups as unknowns; `names` of these, if not `name_of` their numbers."""
    for number, group in enumerate(groups):
        block = _with_group(block, group, names[number] if names else name_of(number))
    return block


def name_of(number: int) -> str:
    """Name of the unknowns of a group, by its place among the groups."""
    return f"group {number + 1}"


def without_groups(block: BundleInput, groups: Sequence[Group], done: BundleInput) -> BundleInput:
    """The block as it was given, with the start, the rejections and the scales of the one with groups."""
    observed = []
    for o, c, d in zip(block.observed, with_groups(block, groups).observed, done.observed, strict=True):
        complete = o.again()
        whitener = complete.records.whitener * _scale(c.again().records, d.again().records)
        complete = replace(
            complete,
            records=replace(complete.records, whitener=whitener),
            start={name: d.start.get(name, value) for name, value in o.start.items()},
        )
        observed.append(complete if d.rejected is None else complete.without(d.rejected))
    return replace(done, observed=tuple(observed), parameters=block.parameters)


def _scale(carried: Records, done: Records) -> Float:
    """By what factors the search has changed the whiteners."""
    one = np.ones_like(carried.whitener)
    return np.divide(done.whitener, carried.whitener, out=one, where=carried.whitener != 0)


def _with_group(block: BundleInput, group: Group, name: str) -> BundleInput:
    observed = list(block.observed)
    o, k = observed[group.place], len(group.value)
    H = np.zeros((len(o), o.records.rows, k))
    H[group.rows] = group.H
    if group.H_of_rejected is not None:
        H[group.rejected] = group.H_of_rejected
    labels = tuple(f"{name} {j + 1}" for j in range(k))
    start, free = np.array([group.value, np.zeros(k)]), np.array([group.sigma > 0, [False] * k])
    if o.kind != IMAGE_POINT or block.rays is None:
        unknowns = Unknowns(name, free[:1], labels, [name], add_step)
        observed[group.place] = _carrying(o, unknowns, H, start)
        return replace(block, observed=tuple(observed))
    unit_of_row = np.ones(len(o), dtype=np.int64)
    unit_of_row[np.concatenate([group.rows, group.rejected])] = 0
    group_parameters = ParameterRows(
        name, [name, ""], labels, start, free, start, np.tile(np.eye(k), (2, 1, 1)), free & False, unit_of_row, -H
    )
    parameters = (*block.parameters, group_parameters)
    rays = observed_image_points(block.rays, parameters, o.names, o.group)[0]
    rays = replace(rays, start={**rays.start, **o.start})
    observed[group.place] = rays if o.rejected is None else rays.without(o.rejected)
    return replace(block, observed=tuple(observed), parameters=parameters)


def _carrying(o: Observed, unknowns: Unknowns, H: Float, start: Float) -> Observed:
    """Observations with one more term."""
    return replace(
        o,
        records=_with_term(o.records, unknowns.name, H),
        unknowns=(*o.unknowns, unknowns),
        start={**o.start, unknowns.name: start[:1]},
        unreduced=None if o.unreduced is None else _carrying(o.unreduced, unknowns, H, start),
    )


def _with_term(plain: Records, name: str, H: Float) -> Records:
    def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        v, jacobians = plain.evaluate(state, rows)
        return v + H[rows] @ state[name][0], (*jacobians, H[rows])

    touches = (*plain.touches, (name, np.zeros(len(plain.active), dtype=np.int32)))
    return replace(plain, touches=touches, evaluate=evaluate, compiled=None)
