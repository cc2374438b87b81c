"""By how much the standard deviations of classes of observations are wrong, robustly: before anything is rejected.

A class (a kind, its plan or height, the image points of a camera) has the scale s: its standard deviations should be s
times those given. With whitened residuals v_i and their redundancy numbers r_i, w_i = v_i / sqrt(r_i) and

    s^2 = sum v_i^2 / (c sum r_i)   over |w_i| <= k s,        c = 1 - 2 k phi(k) / (2 Phi(k) - 1)

from s = median |w_i| / 0.6745 on. Residuals beyond k s count for nothing, so that gross errors do not either; c makes s
right for normal ones. Where s = 1 is right, s^2 f is distributed nearly as chi-square with f = EFFICIENCY sum r_i
degrees of freedom: s is as sharp as all residuals of so much less redundancy.

A scale counts as different from 1, or from another, where chance does not explain it (`ALARM`, for all classes of
a block together) and where it matters. With a redundancy below `ESTIMABLE` a class keeps its standard deviations,
unless the residuals of its kind tell by their cofactors together that they are wrong (`small_scales`).

Source: Huber 1981, Robust Statistics, 5 (M-estimates of scale); Foerstner 1979 (redundancy numbers of groups).
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri, ndtr

from aatri.adjustment.statistics.limits import ALARM, MEDIAN_OF_NORMAL
from aatri.adjustment.statistics.variance_components import ESTIMABLE, LEAST_SHARE
from aatri.arrays import Bool, Float, Int

K = 2.5
"""Residuals beyond K times their scale do not count."""

EFFICIENCY = 0.666
"""Of the M-estimate for K with normal residuals: var(ln s) = 1 / (2 EFFICIENCY r)."""

MATTERS = 1.25
"""Tests with standard deviations wrong by less than this are as good as right; also the bound of a warned sigma0."""

_INSIDE = 2.0 * float(ndtr(K)) - 1.0
_CONSISTENT = 1.0 - 2.0 * K * float(np.exp(-0.5 * K**2) / np.sqrt(2.0 * np.pi)) / _INSIDE
_ITERATIONS = 20


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
    """(g,). Scales that have passed a test of their own (`small_scales`)."""

    @property
    def differing(self) -> Float:
        """The scale of classes where it is clearly not 1, and 1 elsewhere, (g,): what tests are made with."""
        low, high = self._by_chance(EFFICIENCY * self.redundancy)
        off = (self.scale < np.minimum(low, 1.0 / MATTERS)) | (self.scale > np.maximum(high, MATTERS))
        return np.where(self.estimable & (off if self.tested is None else off | self.tested), self.scale, 1.0)

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
    usable = (group >= 0) & np.isfinite(v) & (redundancy > LEAST_SHARE)
    scale, total = np.ones(n_groups), np.zeros(n_groups)
    for g in range(n_groups):
        rows = usable & (group == g) if n_groups > 1 else usable
        of_group = redundancy[rows]
        total[g] = of_group.sum()
        if total[g] >= ESTIMABLE:
            scale[g] = robust_scale(v[rows], of_group)
    estimable = (scale > 0) & (total >= ESTIMABLE)
    return ClassScales(np.where(scale > 0, scale, 1.0), total, estimable)


def robust_scale(v: Float, redundancy: Float) -> float:
    """The scale s of some whitened residuals; 0 where half of them vanish.

    Parameters
    ----------
    v : (n,) float64
    redundancy : (n,) float64
        Above zero.
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
