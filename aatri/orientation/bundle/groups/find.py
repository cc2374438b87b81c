"""Whether observations of a unit are wrong together: the score test of what they may have in common.

With M and g of `adjustment.covariance.score`, v'v = W, redundancy r, and k the rank of M,

    gain = g'M^-1 g,    s^2 = max(1, (W - gain) / (r - k)),    gain / s^2  ~  chi^2(k) where nothing is wrong

Tested is at `ALARM` over the number of tests made, so that of a thousand blocks without errors one is told a group, and
with the standard deviations that the kind has by its own residuals. A
cause of fewer parameters is preferred to one that gains no more than `SEPARABLE` beyond it; others that explain as much
cannot be told apart from it, and are named too. Where single observations are tested as well, the group must gain more
than the largest of them alone, and most of its members must fit better with it: two or three wrong ones of a strip are
no shift of the strip.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from aatri.adjustment.adjusted import Adjusted
from aatri.adjustment.covariance.score import Joint, moved, score, with_factor
from aatri.adjustment.records import whitened
from aatri.adjustment.statistics.attribution import SEPARABLE
from aatri.arrays import Float, Int
from aatri.observations.image_points import KIND as IMAGE_POINT
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.groups.effects import Cause, Effects, EffectsOf
from aatri.orientation.bundle.result import BundleResult

ALARM = 1e-3
"""Probability that a block without errors is told a group: shared by the effects, and of each by all its tests."""

MEDIAN, CONTROLLED = 0.4549, 1e-3
"""Median of chi-square of one degree; least redundancy number of a residual that counts."""

AS_GOOD = 0.02
"""Share of a gain by which another explanation may fall short of it and cannot be told apart: beyond `SEPARABLE`, since
one step from a wrong model is not exact."""

MOST_TRIED, EXPLAINS = 4, 0.3
"""Groups that are returned, and the share that each explains at least of what the best does: one step from a model that
is far off tells them apart only so far, an adjustment with each of them does."""

LEAST_LEFT = 0.1
"""Share of an effect on a neighbourhood that the orientation of its image leaves at least, of what the points leave: of
a shift of 0.7 of the points of an image a linear field over the image takes up 0.9."""

Key = tuple[int, str, str, str]


@dataclass(frozen=True)
class Group:
    """Observations that are wrong together, and how.

    Attributes
    ----------
    place : int
        Of their kind among the observations.
    kind, per, unit, cause : str
        As in `effects`.
    rows : (n,) int
    H : (n, m, k) float64
        Derivatives of their residuals by the parameters of the cause.
    value, sigma : (k,) float64
        Parameters, in units of the kind; a posteriori where sigma0 is above 1.
    gain : float
        By which they reduce v'v, over s^2.
    sigma0 : float
        With the parameters.
    harm : float
        Largest change of a coordinate of a point or of a projection centre, in its standard deviations.
    change_m : float
        That change; of a point where one changes by more than its standard deviation.
    moved : str
        What changes so.
    or_else : tuple of (str, str, str)
        Unit's kind, unit and cause of others that explain as much.
    undecided : (j,) int
        Rows of other units of the same kind that explain as much.
    c_mm : float, mm
        Principal distance of its image points.
    removable : bool
        It may be left out.
    """

    place: int
    kind: str
    per: str
    unit: str
    cause: str
    rows: Int
    H: Float
    value: Float
    sigma: Float
    gain: float
    sigma0: float
    harm: float = 0.0
    change_m: float = 0.0
    moved: str = ""
    or_else: tuple[tuple[str, str, str], ...] = ()
    undecided: Int = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    c_mm: float = float("nan")
    removable: bool = False

    @property
    def complexity(self) -> tuple[bool, bool, int]:
        """Of what explains as much the least is taken: cameras of a strip are rare; a camera; the fewest parameters."""
        of_image = self.kind == IMAGE_POINT
        return of_image and self.per == "strip", of_image, len(self.value)

    @property
    def factor(self) -> float:
        """Principal distance of the block over the one that is asked for: the correction is of measured coordinates."""
        return 1.0 - float(self.value[0]) / self.c_mm if self.cause == "principal distance" else 1.0

    @property
    def key(self) -> Key:
        """What tells it from others."""
        return self.place, self.per, self.unit, self.cause

    @property
    def effect(self) -> Float:
        """Part of the residuals of its rows, (n, m)."""
        return self.H @ self.value


@dataclass(frozen=True)
class _Tested:
    effects: Effects
    unit: int
    cause: Cause
    joint: Joint
    gain: float
    alarm: float


def wrong_groups(
    given: BundleInput, result: BundleResult, effects_of: EffectsOf, single: float = 0.0, known: Sequence[Key] = ()
) -> list[Group]:
    """Groups that may be wrong and do harm, the one that explains most first, then those that explain half as much.

    Parameters
    ----------
    given : BundleInput
    result : BundleResult
        Of least squares.
    effects_of : callable
        What is to be tested of a block.
    single : float
        Largest |w| of a single observation; 0: single ones have been searched for.
    known : sequence of key
        Groups that have been found already.
    """
    from scipy.stats import chi2  # slow to import

    adjusted = result.adjusted
    if not adjusted.has_factor or adjusted.down_weighted or adjusted.redundancy < 1:
        return []
    adjusted = with_factor(adjusted)
    effects = list(effects_of(given, result))
    wrong = [t for e in effects for t in _tested(adjusted, result, e, ALARM / len(effects))]
    found: list[Group] = []
    while wrong and len(found) < MOST_TRIED:
        most = max(t.gain for t in wrong)
        if found and most < EXPLAINS * found[0].gain:
            break
        as_good = [t for t in wrong if t.gain >= most - max(SEPARABLE, AS_GOOD * most)]
        best = min(as_good, key=lambda t: (*_group(given, adjusted, result, t).complexity, -t.gain))
        group = _with_harm(given, adjusted, result, _group(given, adjusted, result, best))
        if group.key not in known and group.harm > 1.0:
            before, after, scale = _fitted(adjusted, result, group)
            surely = chi2.logsf(best.gain / scale**2, best.joint.rank) < np.log(best.alarm)
            if surely and (not single or _beyond_single_ones(best.joint, before, after, single)):
                group = _without_strangers(group, before, after) if best.effects.tests else group
                found.append(_with_alternatives(group, [t for t in as_good if t is not best]))
        wrong = [t for t in wrong if t is not best]
    return found


def at_result(given: BundleInput, effects_of: EffectsOf, group: Group, result: BundleResult) -> Group:
    """The group with the derivatives of its residuals at another result; as it is, where that does not offer it."""
    for e in effects_of(given, result):
        if (e.place, e.per) != (group.place, group.per):
            continue
        for unit in np.flatnonzero(e.units == group.unit):
            rows = np.flatnonzero(e.unit == unit)
            columns = next((c.columns for c in e.causes if c.name == group.cause), None)
            if columns is not None and np.array_equal(e.rows[rows], group.rows):
                return replace(group, H=e.H[rows][:, :, list(columns)])
    return group


def _without_strangers(group: Group, before: Float, after: Float) -> Group:
    """Without the rows that fit much worse with it: a neighbourhood that was tried may hold some that did not move."""
    mine = (after**2).sum(axis=1) < (before**2).sum(axis=1) + SEPARABLE
    return replace(group, rows=group.rows[mine], H=group.H[mine])


def _with_alternatives(group: Group, others: list[_Tested]) -> Group:
    """What else explains as much: other causes, and other units of the same kind, of each set of rows the best."""
    rows, named = group.rows, list[tuple[str, str, str]]()
    for t in sorted(others, key=lambda t: -t.gain):
        mine = t.effects.rows[t.effects.unit == t.unit]
        same = (t.effects.place, t.effects.per) == (group.place, group.per)
        if same and len(np.intersect1d(mine, rows)):
            continue
        named.append((t.effects.per, str(t.effects.units[t.unit]), t.cause.name))
        rows = np.union1d(rows, mine) if same else rows
    return replace(group, or_else=tuple(dict.fromkeys(named)), undecided=np.setdiff1d(rows, group.rows))


def _tested(adjusted: Adjusted, result: BundleResult, effects: Effects, alarm: float) -> Iterator[_Tested]:
    """Score tests of all units, those that are beyond the limit."""
    from scipy.stats import chi2  # slow to import

    alarm /= max(effects.tests, len(effects.units)) * len(effects.causes)
    records, row = result.in_problem(effects.place)
    least_gain = LEAST_LEFT * float(chi2.isf(alarm, effects.H.shape[2])) if effects.tests else 0.0
    scores = score(adjusted, records, row[effects.rows], effects.H, effects.unit, least_gain)
    for cause in effects.causes:
        gain, rank = scores.gains(cause.columns)
        gain /= _variance(adjusted, gain, rank)
        for unit in np.flatnonzero((rank > 0) & (gain > chi2.isf(alarm, np.maximum(rank, 1)))).tolist():
            yield _Tested(effects, unit, cause, scores.joint(unit, cause.columns), float(gain[unit]), alarm)


def _variance(adjusted: Adjusted, gain: Float, rank: Int) -> Float:
    """Of unit weight with the parameters, at least 1."""
    left = adjusted.redundancy - rank
    W = adjusted.cost
    return np.maximum(1.0, np.where(left > 0, (W - gain) / np.maximum(left, 1), W / adjusted.redundancy))


def _group(given: BundleInput, adjusted: Adjusted, result: BundleResult, t: _Tested) -> Group:
    e, variance = t.effects, float(_variance(adjusted, np.array(t.joint.gain), np.array(t.joint.rank)))
    mine = np.flatnonzero(e.unit == t.unit)
    sigma = np.sqrt(np.diagonal(t.joint.covariance) * variance)
    kind = result.observations[e.place].observed.kind
    H, c_mm = e.H[mine][:, :, list(t.cause.columns)], float("nan")
    if kind == IMAGE_POINT and given.rays is not None:
        c_mm = float(np.median(given.rays.c_mm[e.rows[mine]]))
    return Group(e.place, kind, e.per, str(e.units[t.unit]), t.cause.name, e.rows[mine], H, t.joint.value,
                 sigma, t.gain, float(np.sqrt(variance)), c_mm=c_mm, removable=e.removable)  # fmt: skip


def _fitted(adjusted: Adjusted, result: BundleResult, group: Group) -> tuple[Float, Float, float]:
    """Whitened residuals of a group before and after it is carried; scale of its whole kind after, at least 1.

    Where the standard deviations of a kind are too small, all that its observations have in common is significant.
    """
    found = result.observations[group.place]
    records, rows = found.observed.records, np.flatnonzero(found.used)
    change = moved(adjusted, records, group.rows, group.effect)
    v, jacobians = whitened(records, adjusted.state, rows)
    effect = np.zeros((len(found.observed), records.rows))
    np.add.at(effect, group.rows, group.effect)
    after = v + _whitened_effect(records.whitener[rows], effect[rows])
    for (name, block), J in zip(records.touches, jacobians):
        after += np.einsum("nmk,nk->nm", J, change[name][block[rows]])
    r = 1.0 - np.einsum("nii->ni", found.covariance[rows])
    w2 = (after**2)[tested := records.observed_components()[rows] & (r > CONTROLLED)] / r[tested]
    mine = np.isin(rows, group.rows)
    return v[mine], after[mine], float(np.sqrt(max(1.0, np.median(w2) / MEDIAN if len(w2) else 1.0)))


def _beyond_single_ones(joint: Joint, before: Float, after: Float, single: float) -> bool:
    """Whether a group explains more than its largest member could, and most of its members."""
    better = (after**2).sum(axis=1) < (before**2).sum(axis=1)
    return joint.gain >= single**2 + SEPARABLE and bool(better.mean() > 0.5 + 0.5 / np.sqrt(len(better)))


def _whitened_effect(whitener: Float, effect: Float) -> Float:
    return whitener * effect if whitener.ndim == 2 else np.einsum("nij,nj->ni", whitener, effect)


def _with_harm(given: BundleInput, adjusted: Adjusted, result: BundleResult, group: Group) -> Group:
    """What the group does to coordinates, those of points first."""
    change = moved(adjusted, result.observations[group.place].observed.records, group.rows, group.effect)
    found = group
    for name, ids, what in ((POINT, given.point_ids, "point"), (POSE, given.image_ids, "projection centre of image")):
        if name not in change or not len(change[name]):
            continue
        sigma = group.sigma0 * np.sqrt(np.einsum("nii->ni", result.covariances[name])[:, :3])
        by = np.abs(change[name][:, :3])
        ratio = np.divide(by, sigma, out=np.zeros_like(by), where=sigma > 0)
        row, axis = np.unravel_index(int(ratio.argmax()), ratio.shape)
        if ratio[row, axis] > max(found.harm, 1.0) or (name == POINT and ratio[row, axis] > 0):
            harmless, found = found.harm <= 1.0, replace(found, harm=float(ratio[row, axis]))
            if harmless:
                called = f"{'XYZ'[axis]} of {what} {np.asarray(ids)[row]}"
                found = replace(found, change_m=float(by[row, axis]), moved=called)
    return found
