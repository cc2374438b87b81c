"""How many records of a kind may be rejected: as many as its redundancy can answer for.

A kind of n records has the redundancy R = sum tr(R_i) / m_i, counted in records. R - g of them are left to test the
others when g are out. Up to half of R may go; of a small kind three may, as long as R allows it: thirteen control
points in a block of strong rays have R = 10 and room for five, six have R = 3.7 and room for three. One may go wherever
anything is tested at all: control that is far better than the rays has next to no redundancy, and its tests, which know
that, tell all the same; whether it is the right one shows as each is left out (`leave_one_out`). Where more contradict
the rest, single gross errors explain nothing: the kind is named, and all of it stays, never a part.

Source: Rousseeuw and Leroy 1987 (half is the most that a fit can bear); Foerstner 1979 (redundancy of groups).
"""

import numpy as np

from aatri.arrays import Float, Int

TESTED = 0.01
"""Redundancy of a kind below which nothing tests it."""

SMALL_ROOM = 3
"""So many of the smallest kind may be wrong, if its redundancy allows it."""


def room_of(redundancy: Float, count: Int, max_share: float | None = None) -> Int:
    """How many records of each kind may be rejected.

    Parameters
    ----------
    redundancy : (g,) float64
        Of each kind, in records.
    count : (g,) int
        Its records.
    max_share : float, optional
        This share of a kind instead, where the user says so.

    Returns
    -------
    (g,) int
    """
    half, whole = np.floor(0.5 * redundancy), np.maximum(np.floor(redundancy + 1e-9), redundancy > TESTED)
    room = np.minimum(np.maximum(half, SMALL_ROOM), whole).astype(np.int64)
    return room if max_share is None else np.ceil(max_share * count).astype(np.int64)


def redundancy_in_records(redundancy: Float, components: Float | Int) -> float:
    """R of a kind: sum of tr(R_i) / m_i.

    Parameters
    ----------
    redundancy : (n,) float64
        tr(R_i) of each record; NaN counts as none.
    components : (n,)
        m_i, the components observed.
    """
    share = np.where((components > 0) & np.isfinite(redundancy), redundancy / np.maximum(components, 1), 0.0)
    return float(share.sum())
