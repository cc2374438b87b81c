"""Which unknowns of their own observations tell apart: a drift needs positions of two times, a scale two distances.

Where observations are rejected, or their images take no part, too few of a group may be left for all that they share.
With J the derivatives of those in use by the unknowns of one group, those stay free whose columns are independent of
the ones before: of shift and drift, of scale and addition constant, the first. The others are open whatever else is
observed, and are held where they are.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aatri.adjustment.unknowns import Unknowns
from aatri.arrays import Bool, Float
from aatri.notes import Note
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.block import BundleInput, Participants

SAME = 1e-12
"""Square of the sine between a column and those before it below which it is one of them: that of rounding in J'J."""


def separable_unknowns(
    inputs: BundleInput, part: Participants, unknowns: Sequence[Unknowns]
) -> tuple[list[Unknowns], list[Note]]:
    """Unknowns, those held that the observations in use cannot tell from others of their group; and which these are."""
    normals = {u.name: np.zeros((len(u.free), u.size, u.size)) for u in unknowns}
    counted = {name for name in normals if name not in (POSE, POINT)}
    for o in inputs.observed:
        touched = {name for name, _ in o.records.touches}
        counted -= touched if {POSE, POINT} <= touched or o.refitted is not None else set()
    for o, rows in zip(inputs.observed, part.rows):
        rows = rows[o.records.active[rows]]
        if not len(rows) or not counted & {name for name, _ in o.records.touches}:
            continue
        observed_columns = o.records.observed_components()[rows, :, None]
        for (name, block), J in zip(o.records.touches, o.records.evaluate(part.start, rows)[1]):
            if name in counted:
                np.add.at(normals[name], block[rows], np.einsum("nmi,nmj->nij", J * observed_columns, J))
    kept, notes = list[Unknowns](), list[Note]()
    for u in unknowns:
        free = _independent(normals[u.name], u.free) if u.name in counted else u.free
        labels = tuple(u.label(block, scalar) for block, scalar in zip(*np.nonzero(u.free & ~free)))
        kept.append(replace(u, free=free))
        notes += [Note("warning", "held, as the observations in use do not tell them", labels)] if labels else []
    return kept, notes


def _independent(N: Float, free: Bool) -> Bool:
    """Which free columns of J are independent of the free ones before, block by block, from N = J'J, (n, k, k)."""
    remainder, independent = N.copy(), free.copy()
    for k in range(N.shape[1]):
        independent[:, k] &= remainder[:, k, k] > SAME * N[:, k, k]
        column = np.where(independent[:, k, None], remainder[:, :, k], 0.0)
        pivot = np.where(independent[:, k], remainder[:, k, k], 1.0)
        remainder -= column[:, :, None] * column[:, None, :] / pivot[:, None, None]
    return independent
