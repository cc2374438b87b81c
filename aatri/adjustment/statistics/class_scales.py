"""By how much the standard deviations of classes of observations are wrong, robustly: before anything is rejected.

A class (a kind, its plan or height, the image points of a camera) has the scale s: its standard deviations should be s
times those given. With whitened residuals v_i and their redundancy numbers r_i, w_i = v_i / sqrt(r_i) and

    s^2 = sum v_i^2 / (c sum r_i)   over |w_i| <= k s,        c = 1 - 2 k phi(k) / (2 Phi(k) - 1)

from s = median |w_i| / 0.6745 on. Residuals beyond k s count for nothing, so that gross errors do not either; c makes s
right for normal ones. The relative standard deviation of s is 0.87 / sqrt(sum r_i) for k = 2.5.

A scale counts as different from 1, or from another, where chance does not explain it (`FALSE_ALARM` of `limits`, for
all classes together) and where it matters. With a redundancy below `ESTIMABLE` a class keeps its standard deviations.

Source: Huber 1981, Robust Statistics, 5 (M-estimates of scale); Foerstner 1979 (redundancy numbers of groups).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from aatri.adjustment.statistics.limits import FALSE_ALARM
from aatri.adjustment.statistics.variance_components import ESTIMABLE, LEAST_SHARE
from aatri.arrays import Bool, Float, Int

K = 2.5
"""Residuals beyond K times their scale do not count."""

SPREAD = 0.8665
"""Standard deviation of ln s times the root of the redundancy, for K: that of the M-estimate with normal residuals."""

MATTERS = 1.25
"""Tests with standard deviations wrong by less than this are as good as right; also the bound of a warned sigma0."""

WEIGHS = 1.35
"""Two equal sources whose standard deviations are wrong by this ratio lose 4 % of precision, by 1.5 already 7 %."""

_INSIDE = 2.0 * float(ndtr(K)) - 1.0
_CONSISTENT = 1.0 - 2.0 * K * float(np.exp(-0.5 * K**2) / np.sqrt(2.0 * np.pi)) / _INSIDE
_ITERATIONS = 20


@dataclass(frozen=True)
class ClassScales:
    """Factors on the standard deviations of classes of observations.

    Attributes
    ----------
    scale : (g,) float64
        1 where not estimable.
    redundancy : (g,) float64
    estimable : (g,) bool
    """

    scale: Float
    redundancy: Float
    estimable: Bool

    @property
    def differing(self) -> Float:
        """The scale of classes where it is clearly not 1, and 1 elsewhere, (g,): what tests are made with."""
        off = np.abs(np.log(self.scale))
        bound = np.maximum(self._chance(SPREAD / np.sqrt(np.maximum(self.redundancy, 1.0))), np.log(MATTERS))
        return np.where(self.estimable & (off > bound), self.scale, 1.0)

    @property
    def weights_are_wrong(self) -> bool:
        """Whether the ratio of two classes is clearly wrong."""
        if not self.estimable.any():
            return False
        used, variance = self.differing, SPREAD**2 / np.maximum(self.redundancy, 1.0)
        main = self.main
        off = np.abs(np.log(used / used[main])) > np.log(WEIGHS)
        spread = np.sqrt(variance + variance[main])
        clear = np.abs(np.log(self.scale / self.scale[main])) > self._chance(spread)
        return bool((off & (clear | ~self.estimable)).any())

    @property
    def main(self) -> int:
        """The class with the most redundancy: its standard deviations are the measure of sigma0."""
        return int(np.argmax(self.redundancy))

    def _chance(self, spread: Float) -> Float:
        """How far ln s may be off by chance."""
        return np.asarray(-float(ndtri(0.5 * FALSE_ALARM / max(len(self.scale), 1))) * spread)


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
    n_groups : int
    """
    usable = (group >= 0) & np.isfinite(v) & (redundancy > LEAST_SHARE)
    scale, total = np.ones(n_groups), np.zeros(n_groups)
    for g in range(n_groups):
        rows = np.flatnonzero(usable & (group == g)) if n_groups > 1 else np.flatnonzero(usable)
        total[g] = redundancy[rows].sum()
        if total[g] >= ESTIMABLE:
            scale[g] = robust_scale(v[rows], redundancy[rows])
    return ClassScales(scale, total, (total >= ESTIMABLE) & (scale > 0))


def robust_scale(v: Float, redundancy: Float) -> float:
    """The scale s of some whitened residuals; 0 where half of them vanish.

    Parameters
    ----------
    v : (n,) float64
    redundancy : (n,) float64
        Above zero.
    """
    w = np.abs(v) / np.sqrt(redundancy)
    scale = float(np.median(w)) / 0.67449
    squares = v**2
    for _ in range(_ITERATIONS if scale > 0 else 0):
        inside = w <= K * scale
        better = float(np.sqrt(squares @ inside / (_CONSISTENT * (redundancy @ inside))))
        if abs(better - scale) <= 1e-3 * scale:
            return better
        scale = better
    return scale
