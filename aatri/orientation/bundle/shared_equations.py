"""Shared images and points that a block alone does not determine: what it observes of them is carried on all the same.

One ray of a point says two things of three coordinates. The block is adjusted without it; in its reduced normal
equations the ray stands, linearised at the adjusted image and where the point may lie: at its start, else on the ray,
as deep as the nearest point of the image. These equations are singular, and become regular with those of another block.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State, Unknowns
from aatri.arrays import Bool, Float, finite_rows
from aatri.observations.poses import POINT, POSE, Poses
from aatri.orientation.bundle.block import Participants, absent_coordinates, unknowns_of
from aatri.orientation.bundle.rounds import AdjustedBlock
from aatri.orientation.bundle.seen_distances import on_their_rays

INFORMATION = "information"
"""Kind of what another block has handed over: it stands in the equations of that block."""


@dataclass(frozen=True)
class EquationsOfShared:
    """What normal equations of an adjusted block are made of, with the shared unknowns that it does not determine."""

    unknowns: tuple[Unknowns, ...]
    records: tuple[Records, ...]
    state: State
    keep: dict[str, Bool]
    """Images and points that stay."""
    used: tuple[Bool, ...]
    """Rows in use of each of the observations."""


def shared_equations(
    done: AdjustedBlock, determinable: Mapping[str, Bool], at: tuple[Poses, Float] | None = None
) -> EquationsOfShared:
    """The observations and unknowns of an adjusted block, and those of wanted images and points left out of it.

    Parameters
    ----------
    determinable : mapping of group to (n,) bool
        Images and points that other blocks have too.
    at : Poses and (n_points, 3) float64, optional
        Where orientations and points are linearised, NaN and default: where they are adjusted.
    """
    stated, result = done.inputs, done.result
    adjusted = {POSE: result.image_adjusted, POINT: result.point_adjusted}
    poses = result.adjusted.state[POSE].where(adjusted[POSE], stated.poses)
    xyz_m = np.where(adjusted[POINT][:, None], result.adjusted.state[POINT], stated.xyz_m)
    if at is not None:
        poses, xyz_m = at[0].where(at[0].oriented, poses), np.where(finite_rows(at[1])[:, None], at[1], xyz_m)
    if stated.rays is not None:
        xyz_m = on_their_rays(stated.rays, poses, xyz_m, determinable[POINT] & ~finite_rows(xyz_m))
    state: dict[str, Any] = {**result.adjusted.state, POSE: poses, POINT: xyz_m}
    started = {POSE: poses.oriented, POINT: finite_rows(xyz_m)}
    more = {group: determinable[group] & ~adjusted[group] & started[group] for group in adjusted}
    records, used, touched = [], [], {group: np.zeros(len(free), dtype=bool) for group, free in more.items()}
    for o in result.observations:
        rows = o.records.active & (o.observed.kind != INFORMATION) & ~np.bool_(o.observed.exact)
        of_more = np.zeros(len(rows), dtype=bool)
        for group, block in o.records.touches:
            if group in more:
                rows &= (adjusted[group] | more[group])[block]
                of_more |= more[group][block]
        rows &= of_more
        if rows.any():
            records.append(o.records.take(np.flatnonzero(rows)))
            for group, block in o.records.touches:
                if group in more:
                    touched[group][block[rows]] = True
        used.append(o.used | rows)
    more = {group: free & touched[group] for group, free in more.items()}
    unknowns = result.adjusted.problem.unknowns
    if records:
        unknowns = _with_free(done, unknowns, state, more)
    keep = {group: determinable[group] & (adjusted[group] | more[group]) for group in more}
    return EquationsOfShared(unknowns, (*result.adjusted.problem.observed, *records), state, keep, tuple(used))


def _with_free(
    done: AdjustedBlock, unknowns: tuple[Unknowns, ...], state: State, more: Mapping[str, Bool]
) -> tuple[Unknowns, ...]:
    """The unknowns of an adjustment, those of more images and points free as they would be in it."""
    stated, of = done.inputs, {u.name: np.ones(len(u.free), dtype=bool) for u in unknowns}
    absent = absent_coordinates(stated.observed, len(stated.point_ids))
    poses = np.ones((len(stated.image_ids), 6), dtype=bool)
    declared = unknowns_of(stated, Participants(state, of, (), absent), poses, stated.poses.position_m)
    free = {u.name: u.free for u in declared}
    return tuple(
        replace(u, free=np.where(more[name][:, None], free[u.name], u.free))
        if (name := u.joins or u.name) in more
        else u
        for u in unknowns
    )
