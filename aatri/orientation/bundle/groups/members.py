"""Which image points of a neighbourhood are moved: windows around a point hold others too, and not all that are.

From a window that is significant, in turn, until the gain grows no more: the shift p of its members, everything
adjusted with it; and members anew, of all points around the same centre those that fit better with p than without. The
first window was tested, so that to choose its members makes no false alarm.
"""

from dataclasses import replace

import numpy as np

from aatri.adjustment.covariance.score import Joint, moved, score
from aatri.adjustment.records import whitened
from aatri.adjustment.stepping.adjusted import Adjusted
from aatri.arrays import Bool, Float
from aatri.orientation.bundle.groups.candidates import Candidates
from aatri.orientation.bundle.result import BundleResult

FEWEST_MEMBERS = 3
"""Fewer are single wrong points."""

ROUNDS = 6


def with_members(
    adjusted: Adjusted, result: BundleResult, candidates: Candidates, unit: int
) -> tuple[Candidates, Joint] | None:
    """A neighbourhood of just those that are moved, its only unit; None where no choice gains more than the window.

    Parameters
    ----------
    adjusted : Adjusted
        Of `result`, with its factor.
    candidates : Candidates
        Windows of several sizes around the same centres: those of one centre have the same name.
    unit : int
        The window to begin with.
    """
    around = np.flatnonzero((candidates.units == candidates.units[unit])[candidates.unit])
    rows, first = np.unique(candidates.rows[around], return_index=True)
    H, columns = candidates.H[around[first]], candidates.causes[0].columns
    plain, (records, row) = result.observations[candidates.place].observed.records, result.in_problem(candidates.place)
    v, jacobians = whitened(plain, adjusted.state, rows)
    H_whitened = plain.whitener[rows][:, :, None] * H if plain.whitener.ndim == 2 else plain.whitener[rows] @ H
    window: Bool = np.isin(rows, candidates.rows[candidates.unit == unit])
    members = window
    best: tuple[Bool, Joint] | None = None
    for _ in range(ROUNDS):
        one = np.zeros(int(members.sum()), dtype=np.int64)
        joint = score(adjusted, records, row[rows[members]], H[members], one).joint(0, columns)
        if best is not None and joint.gain <= best[1].gain:
            break
        best = members, joint
        change = moved(adjusted, plain, rows[members], H[members] @ joint.value)
        alone: Float = v.copy()
        for (name, block), J in zip(plain.touches, jacobians):
            alone += np.einsum("nmk,nk->nm", J, change[name][block[rows]])
        together = alone + H_whitened @ joint.value
        members = np.asarray((together**2).sum(axis=1) < (alone**2).sum(axis=1))
        if members.sum() < FEWEST_MEMBERS:
            break
    assert best is not None
    chosen, joint = best
    if np.array_equal(chosen, window):
        return None
    of_members = replace(
        candidates,
        units=candidates.units[[unit]],
        rows=rows[chosen],
        unit=np.zeros(int(chosen.sum()), dtype=np.int64),
        H=H[chosen],
        dispersion=None if candidates.dispersion is None else candidates.dispersion[[unit]],
    )
    return of_members, joint
