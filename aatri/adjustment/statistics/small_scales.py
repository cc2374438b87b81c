"""By how much the standard deviations of a small class of observations are wrong: thirteen control points, say.

Where its standard deviations are a fifth of the true ones the others give way, the redundancy of the class is next to
nothing, and the size of its residuals says little: their *distribution* does. With errors of s times the standard
deviations given its whitened residuals v, of cofactor R (of all of them together), have along the eigenvectors of R

    z_k = u_k'v / sqrt(l_k)  ~  N(0, 1 + (s^2 - 1) l_k),      -2 ln L(s) = sum ln(1 + (s^2 - 1) l_k) + z_k^2 / (...)

s maximises it (restricted maximum likelihood). s = 1 is left where 2 ln(L(s) / L(1)) is beyond the quantile of half a
chi-square of one degree at `ALARM`, either way, and gross errors do not explain as much where s is above 1, of up to
`room.SMALL_ROOM` records of the class or of one of another kind, given values of a camera too: each lets v'R^-v fall by
v_j'R_jj^-1 v_j, of all components of the record or of one, and costs the quantile of chi-square of so many degrees at
`ALARM` (`SEPARABLE` of another kind).

Source: Patterson and Thompson 1971 (restricted maximum likelihood); Koch 1986 (variance components).
"""

import numpy as np
from scipy.special import chdtri

from aatri.adjustment.statistics.limits import ALARM, SEPARABLE
from aatri.adjustment.statistics.rejection import SMALL_ROOM
from aatri.arrays import Float, Int

LIMIT = float(chdtri(1.0, 2.0 * ALARM))

UNTESTED = 0.5
"""Redundancy up to which nothing tests the others without one record: any of three control points may be wrong."""

_SCALES = np.concatenate([[1.0], np.exp(np.linspace(np.log(0.01), np.log(5000.0), 503))])
"""The first is 1. The least is below `NO_ERRORS` of a search, which takes such a class for one without errors."""


def small_class_scale(v: Float, R: Float, record: Int, gain_of_others: float = 0.0) -> tuple[float, float]:
    """Scale of the standard deviations of a class, 1 where it is not told, and the redundancy that it leads to.

    Parameters
    ----------
    v : (n,) float64
        Whitened residuals of all components.
    R : (n, n) float64
        Their cofactor.
    record : (n,) int
        Record of each component: gross errors are those of records.
    gain_of_others : float
        By how much leaving out one record of another kind reduces the squares of all: a wrong control point, beside
        which all positions seem to be off.
    """
    size, axes = np.linalg.eigh(R)
    seen = size > 1e-9
    size, z2 = size[seen], (axes[:, seen].T @ v) ** 2 / size[seen]
    variance = 1.0 + (_SCALES[:, None] ** 2 - 1.0) * size
    cost = (np.log(variance) + z2 / variance).sum(axis=1)
    best = int(cost.argmin())
    gain = float(cost[0] - cost[best])
    scale = float(_SCALES[best])
    if gain <= LIMIT or (
        scale > 1.0 and gain <= max(gain_of_others - SEPARABLE, _gain_of_gross_errors(v, R, record, scale))
    ):
        return 1.0, float(size.sum())
    return scale, float((scale**2 * size / variance[best]).sum())


def may_differ(v: Float, redundancy: Float, record: Int, gain_of_others: float) -> bool:
    """Whether the scale may differ from 1, as far as redundancy numbers say: the whole cofactor costs a factorisation.

    Parameters
    ----------
    v, redundancy : (n,) float64
        Whitened residuals of all components, and their redundancy numbers.
    record, gain_of_others
        As of `small_class_scale`.
    """
    share = max(float((v**2).sum() / redundancy.sum()), 1e-12) if redundancy.any() else 1.0
    most = redundancy.sum() * (share - 1.0 - np.log(share))  # all of it in so many directions as there is redundancy
    too_large = share < 1.0 and most > LIMIT
    return bool(too_large or small_class_scale(v, np.diag(redundancy), record, gain_of_others)[0] != 1.0)


def _beyond_chance(g: Float, M: Float) -> float:
    """What parameters with the gradient g and the information M explain, less what chance would at `ALARM`."""
    size, axes = np.linalg.eigh(M)
    seen = size > 1e-9 * size[-1]
    explained = ((axes[:, seen].T @ g) ** 2 / size[seen]).sum()
    return float(explained - chdtri(max(np.count_nonzero(seen), 1), ALARM))


def _gain_of_gross_errors(v: Float, R: Float, record: Int, scale: float) -> float:
    """What the gross errors of one, two or three records explain, less what chance would: the largest.

    Each is asked for by itself; that the largest is chosen is not charged, in favour of gross errors. Infinite where
    without one nothing tests the others, with standard deviations of this scale: it explains all there is.
    """
    numbers = np.unique(record)
    if len(numbers) == 1 and len(v) <= 3:  # a single point, and not the coordinates of several with their covariances
        return np.inf
    of_records = [np.flatnonzero(record == k) for k in numbers]
    candidates = [*of_records, *(rows[[k]] for rows in of_records if len(rows) > 1 for k in range(len(rows)))]
    total, most = 0.0, 0.0
    for count in range(min(SMALL_ROOM, len(numbers) - 1)):
        gains = [_beyond_chance(v[rows], R[np.ix_(rows, rows)]) for rows in candidates]
        rows, gain = candidates[int(np.argmax(gains))], max(gains)
        candidates = [other for other in candidates if record[other[0]] != record[rows[0]]]
        total += gain
        most = max(most, total)
        if count == 0 and _redundancy(_without(R, np.flatnonzero(record == record[rows[0]]))[1], scale) < UNTESTED:
            return np.inf
        by, R = _without(R, rows)
        v = v - by @ v[rows]
    return most


def _redundancy(R: Float, scale: float) -> float:
    """Of residuals of the cofactor R, with standard deviations of a scale."""
    size = np.linalg.eigvalsh(R)
    return float((scale**2 * size / (1.0 + (scale**2 - 1.0) * size))[size > 1e-9].sum())


def _without(R: Float, rows: Int) -> tuple[Float, Float]:
    """By how much some components change the residuals of all, and the cofactor of these without them."""
    by = R[:, rows] @ np.linalg.pinv(R[np.ix_(rows, rows)], 1e-9, hermitian=True)
    return by, R - by @ R[rows]
