"""Positions of a drift group: GNSS with a shift and a linear drift that its images share.

    v = D (X0 + R a - X_observed) + s + (t - t_mean) d,    dv/ds = I,    dv/dd = (t - t_mean) I

D turns into the axes of the block (`positions`), along which shift and drift run. s is the shift and d the drift per
unit of time, both free; t is the time of exposure in seconds, where a group has none the sequence of its images; t_mean
the mean over the group. A group whose images have one time has no drift.
Source: Ackermann 1984, Friess 1986; docs/formulas.md 5.3.
"""

from __future__ import annotations

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State, Unknowns, add_step
from aatri.arrays import Float, Int, Text
from aatri.observations.observed import Given, Observed, named
from aatri.observations.positions import PositionOptions, Positions, placed, position_records, positions_of, taken

DRIFT = "drift"

USES = ("exterior.drift_group",)


def drift(given: Given, options: PositionOptions) -> tuple[Observed, ...]:
    """Observed positions of the block that belong to a drift group."""
    block = given.block
    found = positions_of(block)
    group = block.exterior.drift_group[found.row]
    rows = np.flatnonzero(group != "")
    if not len(rows) or not options.use:
        return ()
    found, group = taken(found, rows), group[rows]
    time = group_times(block.images.time_s[found.image], block.images.sequence[found.image], group)
    found, derivatives = placed(given, found)
    return observed_drift(found, given.origin_m, group, time, block.images.id[found.image], derivatives)


def group_times(time_s: Float, sequence: Float, group: Text) -> Float:
    """Times reduced to the mean of their group, (n,): seconds, or the sequence where a group lacks times."""
    found = np.zeros(len(group))
    for name in np.unique(group):
        mine = group == name
        t = time_s[mine] if np.isfinite(time_s[mine]).all() else sequence[mine]
        if np.isfinite(t).all():
            found[mine] = t - t.mean()
    return found


def observed_drift(
    rows: Positions, origin_m: Float, group: Text, time: Float, names: Text, derivatives: Float | None = None
) -> tuple[Observed, ...]:
    """Positions with shift and drift, given group, reduced time and image of each."""
    ids, block = np.unique(group, return_inverse=True)
    plain = position_records(rows.image, rows.position_m - origin_m, rows.covariance_m2, rows.lever_arm_m, derivatives)

    def evaluate(state: State, some: Int) -> tuple[Float, tuple[Float, ...]]:
        v, (by_pose,) = plain.evaluate(state, some)
        by_drift = np.concatenate([np.broadcast_to(np.eye(3), (len(some), 3, 3)), time[some, None, None] * np.eye(3)],
                                  axis=2)  # fmt: skip
        return v + np.einsum("nij,nj->ni", by_drift, state[DRIFT][block[some]]), (by_pose, by_drift)

    touches = (*plain.touches, (DRIFT, block.astype(np.int32)))
    records = Records(plain.name, touches, evaluate, plain.whitener, plain.active)
    free = np.ones((len(ids), 6), dtype=bool)
    free[:, 3:] = (np.bincount(block, np.abs(time)) > 0)[:, None]
    labels = ("shift X", "shift Y", "shift Z", "drift X", "drift Y", "drift Z")
    unknowns = Unknowns(DRIFT, free, labels, ids, add_step)
    start = {DRIFT: np.zeros((len(ids), 6))}
    return (Observed(records, rows.row, named(image=names), "m", unknowns=(unknowns,), start=start),)
