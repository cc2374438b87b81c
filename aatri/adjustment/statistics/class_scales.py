"""By how much the standard deviations of classes of observations are wrong, robustly: before anything is rejected.

A class (a kind, its plan or height, the image points of a camera) has the scale s: its standard deviations should be s
times those given. With whitened residuals v_i and their redundancy numbers r_i, w_i = v_i / sqrt(r_i) and

    s^2 = sum v_i^2 / (c sum r_i)   over |w_i| <= k s,        c = 1 - 2 k phi(k) / (2 Phi(k) - 1)

from s = median |w_i| / 0.6745 on. Residuals beyond k s count for nothing, so that gross errors do not either; c makes s
right for normal ones. Where s = 1 is right, s^2 f is distributed nearly as chi-square with f = EFFICIENCY sum r_i
degrees of freedom: s is as sharp as all residuals of so much less redundancy.

A scale counts as different from 1, or from another, where chance does not explain it (`ALARM`, for all classes of a
block together) and where it matters. With a redundancy below `ESTIMABLE_REDUNDANCY` a class keeps its standard
deviations, unless the residuals of its kind tell by their cofactors together that they are wrong:

A small class is thirteen control points, say. Where its standard deviations are a fifth of the true ones the others
give way, the redundancy of the class is next to nothing, and the size of its residuals says little: their
*distribution* does. With errors of s times the standard deviations given its whitened residuals v, of cofactor R (of
all of them together), have along the eigenvectors of R

    z_k = u_k'v / sqrt(l_k)  ~  N(0, 1 + (s^2 - 1) l_k),      -2 ln L(s) = sum ln(1 + (s^2 - 1) l_k) + z_k^2 / (...)

s maximises it (restricted maximum likelihood). s = 1 is left where 2 ln(L(s) / L(1)) is beyond the quantile of half a
chi-square of one degree at `ALARM`, either way, and gross errors do not explain as much where s is above 1, of up to
`room.SMALL_ROOM` records of the class or of one of another kind, given values of a camera too: each lets v'R^-v fall by
v_j'R_jj^-1 v_j, of all components of the record or of one, and costs the quantile of chi-square of so many degrees at
`ALARM` (`SEPARABLE` of another kind).

Source: Huber 1981, Robust Statistics, 5 (M-estimates of scale); Foerstner 1979 (redundancy numbers of groups);
Patterson and Thompson 1971 (restricted maximum likelihood); Koch 1986 (variance components).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri, ndtr

from aatri.adjustment.statistics.limits import (
    ALARM,
    ESTIMABLE_REDUNDANCY,
    LIMIT_OF_SCALES,
    MATTERS,
    MEDIAN_OF_NORMAL,
    SEPARABLE,
    SILENT_REDUNDANCY,
    SMALL_ROOM,
    UNTESTED_REDUNDANCY,
)
from aatri.arrays import Bool, Float, Int

K = 2.5
"""Residuals beyond K times their scale do not count."""

EFFICIENCY = 0.666
"""Of the M-estimate for K with normal residuals: var(ln s) = 1 / (2 EFFICIENCY r)."""

_INSIDE = 2.0 * float(ndtr(K)) - 1.0
_CONSISTENT = 1.0 - 2.0 * K * float(np.exp(-0.5 * K**2) / np.sqrt(2.0 * np.pi)) / _INSIDE
_ITERATIONS = 20

_SCALES = np.concatenate([[1.0], np.exp(np.linspace(np.log(0.01), np.log(5000.0), 503))])
"""The first is 1. The least is below `NO_ERRORS` of a search, which takes such a class for one without errors."""


@dataclass(frozen=True)
class ClassScales:
    """Factors on the standard deviations of classes of observations."""

    scale: Float
    """(g,). 1 where not estimable."""
    redundancy: Float
    """(g,)."""
    estimable: Bool
    """(g,)."""
    tested: Bool | None = None
    """(g,). Scales that have passed a test of their own (`small_class_scale`)."""

    @property
    def differing(self) -> Float:
        """The scale of classes where it is clearly not 1, and 1 elsewhere, (g,): what tests are made with."""
        low, high = self._by_chance(EFFICIENCY * self.redundancy)
        off = (self.scale < np.minimum(low, 1.0 / MATTERS)) | (self.scale > np.maximum(high, MATTERS))
        return np.where(self.estimable & (off if self.tested is None else off | self.tested), self.scale, 1.0)

    def of(self, classes: Bool) -> ClassScales:
        """Those of some classes alone, (g,)."""
        return replace(self, estimable=self.estimable & classes)

    @property
    def main(self) -> int:
        """The class with the most redundancy."""
        return int(np.argmax(self.redundancy))

    def _by_chance(self, freedom: Float) -> tuple[Float, Float]:
        """Between what a scale of 1 lies with so many degrees of freedom."""
        f, level = np.maximum(freedom, 1.0), 0.5 * ALARM / max(len(self.scale), 1)
        return np.sqrt(chdtri(f, 1.0 - level) / f), np.sqrt(chdtri(f, level) / f)


def class_scales(v: Float, redundancy: Float, group: Int, n_groups: int) -> ClassScales:
    """Scales of all classes.

    Parameters
    ----------
    v : (n,) float64
        Whitened residuals of components.
    redundancy : (n,) float64
        Their redundancy numbers.
    group : (n,) int
        -1: none.
    """
    usable = (group >= 0) & np.isfinite(v) & (redundancy > SILENT_REDUNDANCY)
    scale, total = np.ones(n_groups), np.zeros(n_groups)
    for g in range(n_groups):
        rows = usable & (group == g) if n_groups > 1 else usable
        of_group = redundancy[rows]
        total[g] = of_group.sum()
        if total[g] >= ESTIMABLE_REDUNDANCY:
            scale[g] = robust_scale(v[rows], of_group)
    estimable = (scale > 0) & (total >= ESTIMABLE_REDUNDANCY)
    return ClassScales(np.where(scale > 0, scale, 1.0), total, estimable)


def robust_scale(v: Float, redundancy: Float) -> float:
    """The scale s of some whitened residuals; 0 where half of them vanish.

    Parameters
    ----------
    v : (n,) float64
    redundancy : (n,) float64
        Above zero.

    Examples
    --------
    One gross error among twenty hardly counts:

    >>> normal = np.array([-1.5, -1.0, -0.7, -0.4, -0.1, 0.1, 0.4, 0.7, 1.0, 50.0])
    >>> robust_scale(normal, np.ones(10)) < 1.6
    True
    """
    w = np.abs(v)
    w /= np.sqrt(redundancy)
    scale = float(np.median(w)) / MEDIAN_OF_NORMAL
    for _ in range(_ITERATIONS if scale > 0 else 0):
        inside = w <= K * scale
        # Of all image points together: no copies, as `@` makes one of a mask.
        squares, share = np.einsum("n,n,n->", v, v, inside), np.einsum("n,n->", redundancy, inside)
        better = float(np.sqrt(squares / (_CONSISTENT * share)))
        if abs(better - scale) <= 1e-3 * scale:
            return better
        scale = better
    return scale


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
    if gain <= LIMIT_OF_SCALES or (
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
    too_large = share < 1.0 and most > LIMIT_OF_SCALES
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
        if (
            count == 0
            and _redundancy(_without(R, np.flatnonzero(record == record[rows[0]]))[1], scale) < UNTESTED_REDUNDANCY
        ):
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
