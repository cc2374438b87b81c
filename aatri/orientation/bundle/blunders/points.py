"""What is wrong at ground points: the records of each point against each other, all other unknowns held.

Rays, control coordinates, and whatever else touches one point alone take part, also what is rejected: it is asked
again. Exact coordinates are firm: they give way where else two records would have to. The point is moved to where
the others see it, and everything is looked at again, for the image of a point far off is not linear in it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from aatri.adjusting.limits import UNCERTAIN_DISTANCE
from aatri.adjustment.records import predicted
from aatri.adjustment.statistics.attribution import BlockRecords, Explanation, explain
from aatri.adjustment.statistics.leave_one_out import as_good
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int, finite_rows
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT, Poses
from aatri.orientation.bundle.blunders.limits import FIRM

PASSES = 3

AT_ONCE = 400_000
"""Records at points that are held together, with those that pad the smaller points; 30 MB of derivatives."""

FAR = 1e9
"""Whitened residual of what cannot be seen from where the point stands."""


@dataclass(frozen=True)
class Members:
    """Records at some points: place of their observations, row, slot in the padded arrays."""

    points: Int
    """(n,) int64."""
    place: Int
    row: Int
    block: Int
    slot: Int
    """(r,) int64. `block` counts the points, ascending."""

    def between(self, first: int, last: int) -> Members:
        """Those of some points, one after the other."""
        rows = slice(*np.searchsorted(self.block, [first, last]).tolist())
        own = self.place[rows], self.row[rows], self.block[rows] - first, self.slot[rows]
        return Members(self.points[first:last], *own)

    def of(self, padded: Bool) -> Bool:
        """From padded (n, k) to the records, (r,)."""
        return np.asarray(padded[self.block, self.slot])


@dataclass(frozen=True)
class AtPoints:
    """What is wrong at some points."""

    members: Members
    out: Bool
    undecided: Bool
    """(r,). Of the members."""
    single: Bool
    """(r,). To leave out one record of the member's point is enough."""
    xyz_m: Float
    """(n, 3), m, reduced."""

    def decided_by_block(self, gain: Float) -> AtPoints:
        """The same, with ambiguous points decided by an adjustment of the whole block.

        With all other unknowns held it may be open which record of a point is wrong: wrong control bends the images
        around it until its rays disagree as much as the control does.

        Parameters
        ----------
        gain : (r,) float64
            Of leaving out each member, see `leave_one_out`; NaN not known.
        """
        rejected, undecided, ambiguous = self.out.copy(), self.undecided.copy(), self.undecided & self.single
        all_rows = np.flatnonzero(ambiguous)  # point by point, as the members are
        for rows in np.split(all_rows, np.flatnonzero(np.diff(self.members.block[all_rows])) + 1):
            if np.isfinite(gain[rows]).all():
                equivalent = as_good(gain[rows])
                rejected[rows], undecided[rows] = equivalent, equivalent & (equivalent.sum() > 1)
        return replace(self, out=rejected, undecided=undecided)


def explained(
    observed: tuple[Observed, ...],
    native: tuple[Bool, ...],
    state: State,
    points: Int,
    suspected: Bool,
    limit: tuple[Float, ...],
) -> AtPoints:
    """Find what is wrong at some points.

    Parameters
    ----------
    observed : tuple of Observed
        With nothing rejected.
    native : tuple of (n,) bool
        Rows that may be used: measured, and what else they touch is known.
    points : (n,) int64
        Blocks of POINT, ascending, with a start.
    suspected : (n,) bool
        At least one record is wrong there.
    limit : tuple of (n,) float64
        |w| up to which each record agrees with the others.
    """
    members = members_of(observed, native, points, len(state[POINT]))
    parts = [
        _of_piece(observed, state, members.between(first, last), suspected[first:last], limit)
        for first, last in pairwise(_edges(np.bincount(members.block, minlength=len(points))))
    ]
    columns = (np.concatenate([getattr(p, name) for p in parts]) for name in ("out", "undecided", "single", "xyz_m"))
    return AtPoints(members, *columns)


def _edges(records: Int) -> list[int]:
    """Where pieces of points begin, and the last ends: of (n,) records, padded to the largest, `AT_ONCE` at most."""
    edges, most = [0], 0
    for k, count in enumerate(records.tolist()):
        most = max(most, count)
        if k > edges[-1] and most * (k + 1 - edges[-1]) > AT_ONCE:
            edges.append(k)
            most = count
    return [*edges, len(records)]


def _of_piece(
    observed: tuple[Observed, ...], state: State, members: Members, suspected: Bool, limit: tuple[Float, ...]
) -> AtPoints:
    """The same of the records at some points, which are held together."""
    current: dict[str, Any] = dict(state)
    previous: Bool | None = None
    for _ in range(PASSES):
        records = _at(observed, current, members, limit)
        explanation = explain(records, suspected)
        current = _moved(observed, current, members, records, explanation, limit)
        if previous is not None and (previous == explanation.out).all():
            break
        previous = explanation.out
    return AtPoints(
        members,
        members.of(explanation.out),
        members.of(explanation.undecided),
        explanation.single[members.block],
        current[POINT][members.points],
    )


def members_of(observed: tuple[Observed, ...], native: tuple[Bool, ...], points: Int, n_points: int) -> Members:
    """All records that touch one of the points and no other."""
    block_of = np.full(n_points, -1, dtype=np.int64)
    block_of[points] = np.arange(len(points))
    places, rows, blocks = [], [], []
    for i, (o, use) in enumerate(zip(observed, native)):
        touched = [block for group, block in o.records.touches if group == POINT]
        if len(touched) != 1 or o.components or o.exact:
            continue
        kind_rows = np.flatnonzero(use & (block_of[touched[0]] >= 0))
        places.append(np.full(len(kind_rows), i, dtype=np.int64))
        rows.append(kind_rows)
        blocks.append(block_of[touched[0][kind_rows]])
    place, row, block = (np.concatenate([np.zeros(0, dtype=np.int64), *parts]) for parts in (places, rows, blocks))
    order = np.argsort(block, kind="stable")
    place, row, block = place[order], row[order], block[order]
    first = np.searchsorted(block, block)
    return Members(points, place, row, block, np.arange(len(block)) - first)


def _at(observed: tuple[Observed, ...], state: State, members: Members, limit: tuple[Float, ...]) -> BlockRecords:
    """Whitened residuals and derivatives of the members, padded."""
    n, k = len(members.points), int(members.slot.max(initial=-1)) + 1
    m = max((observed[i].records.rows for i in np.unique(members.place)), default=1)
    v, B = np.zeros((n, k, m)), np.zeros((n, k, m, 3))
    present = np.zeros((n, k), dtype=bool)
    present[members.block, members.slot] = True
    exact, demanded, agrees = [], np.zeros((n, k), dtype=bool), np.ones((n, k))
    for i in np.unique(members.place):
        o, kind_members = observed[i], np.flatnonzero(members.place == i)
        residual, jacobians = predicted(o.records, state, members.row[kind_members])
        point_column = [group for group, _ in o.records.touches].index(POINT)
        block, slot = members.block[kind_members], members.slot[kind_members]
        agrees[block, slot] = limit[i][members.row[kind_members]]
        v[block, slot, : o.records.rows], B[block, slot, : o.records.rows] = residual, jacobians[point_column]
        if o.holds is not None and o.holds.group == POINT:
            exact.append((o, kind_members))
    precision = np.sqrt(np.einsum("nkmi,nkmi->n", B, B))
    for o, kind_members in exact:
        assert o.holds is not None
        rows, block, slot = members.row[kind_members], members.block[kind_members], members.slot[kind_members]
        is_exact, firm = o.holds.scalar[rows], np.where(precision[block] > 0, precision[block], 1.0)[:, None] / FIRM
        misclosure_m = state[POINT][members.points[block]] - o.holds.value[rows]
        v[block, slot, :3] = np.where(is_exact, misclosure_m * firm, v[block, slot, :3])
        demanded[block, slot] = is_exact.any(axis=1)
        B[block, slot, :3] = np.where(is_exact[:, :, None], np.eye(3) * firm[:, :, None], B[block, slot, :3])
    return BlockRecords(np.nan_to_num(v, nan=FAR), np.nan_to_num(B), present, demanded, agrees)


def _moved(
    observed: tuple[Observed, ...],
    state: dict[str, Any],
    members: Members,
    records: BlockRecords,
    explanation: Explanation,
    limit: tuple[Float, ...],
) -> dict[str, Any]:
    """The points where the records kept see them; where they stood if that does not fit better."""
    xyz = np.array(state[POINT])
    xyz[members.points] += np.where(np.isfinite(explanation.step), explanation.step, 0.0)
    moved = {**state, POINT: xyz}
    kept = records.present & ~explanation.out
    before, after = (
        np.where(kept, (r.v**2).sum(axis=2), 0.0).sum(axis=1) for r in (records, _at(observed, moved, members, limit))
    )
    worse = members.points[~(after <= before)]
    xyz[worse] = state[POINT][worse]
    return moved


def with_start(xyz_m: Float, points: Int) -> Int:
    """Those of the points whose coordinates are known."""
    return points[finite_rows(xyz_m[points])]


def well_intersected(rays: ImagePointRows, poses: Poses, xyz_m: Float, points: Int) -> Int:
    """Those of the points whose rays meet at a distance known to a share `UNCERTAIN_DISTANCE`; none of parallel rays.

    Over the distance, the standard deviation along the rays is the root of the largest eigenvalue of
    (sum (c / sigma)^2 (I - d d'))^-1, d the directions to the point.
    """
    use = np.flatnonzero(rays.active & np.isin(rays.point, points) & finite_rows(xyz_m)[rays.point])
    point, image = rays.point[use], rays.image[use]
    away = xyz_m[point] - poses.position_m[image]
    d = away / np.linalg.norm(away, axis=1, keepdims=True)
    weight = (rays.c_mm[use] / rays.sigma_mm[use].mean(axis=1)) ** 2
    N = np.zeros((len(xyz_m), 3, 3))
    np.add.at(N, point, weight[:, None, None] * (np.eye(3) - d[:, :, None] * d[:, None, :]))
    least = np.linalg.eigvalsh(N[points])[:, 0]
    return points[finite_rows(xyz_m[points]) & (least * UNCERTAIN_DISTANCE**2 > 1.0)]
