"""Whether observations of a unit are wrong together: the score test of what they may have in common.

With M and g of `adjustment.covariance.score`, v'v = W, redundancy r, and k the rank of M,

    gain = g'M^-1 g,    s^2 = max(1, (W - gain) / (r - k)),    gain / s^2  ~  chi^2(k) where nothing is wrong

Tested is at `ALARM` over the number of tests made, so that of a thousand blocks without errors one is told a group, and
with the standard deviations that the kind has by its own residuals. A cause of fewer parameters is preferred to one
that gains no more than `SEPARABLE` beyond it; others that explain as much cannot be told apart from it, and are named
too. Where single observations are tested as well, the group must gain more than the largest of them alone, and most of
its members fit better with it: two or three wrong ones of a strip are no shift of it. Nor is one that carries
neighbours along which nothing holds: a share `EXPLAINS` of the gain must be that of others. Of marks the gain counts.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from aatri.adjustment.covariance.score import Joint, moved, score, with_factor
from aatri.adjustment.records import whitened
from aatri.adjustment.statistics.leave_one_out import as_good
from aatri.adjustment.statistics.limits import ALARM, CONTROLLED_COMPONENT, SEPARABLE
from aatri.adjustment.stepping.adjusted import Adjusted
from aatri.adjustment.whitening import times_whitener
from aatri.arrays import Float, Int
from aatri.observations.image_points import KIND as IMAGE_POINT
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.groups.candidates import (
    MARK,
    NEIGHBOURHOOD,
    Candidates,
    CandidatesOf,
    Cause,
    dispersion_of,
)
from aatri.orientation.bundle.groups.group import Group, with_change
from aatri.orientation.bundle.groups.limits import EXPLAINS, MOST_CANDIDATE_GROUPS
from aatri.orientation.bundle.result import BundleResult


@dataclass(frozen=True)
class _Significant:
    """A candidate beyond the limit."""

    candidates: Candidates
    unit: int
    cause: Cause
    joint: Joint
    gain: float
    alarm: float

    @property
    def rows(self) -> Int:
        return np.asarray(self.candidates.rows[self.candidates.unit == self.unit])


def significant_groups(
    block: BundleInput,
    result: BundleResult,
    candidates_of: CandidatesOf,
    single: float = 0.0,
    accepted: Sequence[Group] = (),
) -> list[Group]:
    """Groups that may be wrong and do harm, the one that explains most first, then those that explain half as much.

    Parameters
    ----------
    result : BundleResult
        Of least squares.
    candidates_of : callable
        What is to be tested of a block.
    single : float
        Root of the most that leaving out a single observation gains; 0: single ones have been searched for.
    accepted : sequence of Group
        Groups that are carried already.
    """
    adjusted = result.adjusted
    if not adjusted.has_factor or adjusted.down_weighted or adjusted.redundancy < 1:
        return []
    problem = adjusted.problem.without_lanes()  # copies of the rays, which are not kept with the result
    adjusted = with_factor(replace(adjusted, problem=problem))
    candidates = list(candidates_of(block, result))
    significant = [
        t
        for c in candidates
        for t in _significant(adjusted, result, c, ALARM / len(candidates))
        if not is_carried(t.candidates, t.unit, t.cause, accepted)
    ]
    groups: list[Group] = []
    while significant and len(groups) < MOST_CANDIDATE_GROUPS:
        gain = np.array([t.gain for t in significant])
        if groups and gain.max() < EXPLAINS * groups[0].gain:
            break
        equivalent = [t for t, is_near in zip(significant, as_good(gain)) if is_near]
        best = min(equivalent, key=lambda t: (*_group(block, adjusted, result, t).complexity, -t.gain))
        group = _confirmed(block, adjusted, result, best, single)
        if group is not None:
            groups.append(_with_alternatives(group, [t for t in equivalent if t is not best]))
        significant = [t for t in significant if t is not best]
    return groups


def is_carried(c: Candidates, unit: int, cause: Cause, accepted: Sequence[Group]) -> bool:
    """Whether the unit has the correction already, or all others have it of cameras that the block estimates.

    The same correction twice, at measured and at adjusted coordinates, differs by the residuals and would explain them.
    """
    columns = {other.name: set(other.columns) for other in c.causes}
    same = [g for g in accepted if (g.place, g.per) == (c.place, c.per)]
    have = np.isin(c.units, [g.unit for g in same if columns.get(g.cause, set()) & set(cause.columns)])
    if have[unit] or c.estimated_of is None or not c.estimated_of[unit].any():
        return bool(have[unit])
    have[unit] = True
    return not (c.estimated_of[~have].any(axis=0) & c.estimated_of[unit]).any()


def is_significant(value: Float, covariance: Float) -> bool:
    """Whether parameters of a group that is carried differ from zero together: chi-square at `ALARM`.

    Parameters
    ----------
    value, covariance : (k,), (k, k) float64
        NaN where the covariance is not known: then the group stays.
    """
    if not np.isfinite(covariance).all():
        return True
    unit = np.sqrt(np.diagonal(covariance))  # lengths and angles alike
    if not (unit > 0).all():
        return True
    scaled = value / unit
    return bool(scaled @ np.linalg.lstsq(covariance / np.outer(unit, unit), scaled)[0] > chdtri(len(value), ALARM))


def at_result(block: BundleInput, candidates_of: CandidatesOf, group: Group, result: BundleResult) -> Group:
    """The group with the derivatives of its residuals at another result; as it is, where that does not offer it."""
    for c in candidates_of(block, result):
        if (c.place, c.per) != (group.place, group.per):
            continue
        for unit in np.flatnonzero(c.units == group.unit):
            rows = np.flatnonzero(c.unit == unit)
            columns = next((cause.columns for cause in c.causes if cause.name == group.cause), None)
            if columns is not None and np.array_equal(c.rows[rows], group.rows):
                H = c.H[rows][:, :, list(columns)]
                return _with_rejected(replace(group, H=H), c, int(unit), columns)
    return group


def _with_rejected(group: Group, candidates: Candidates, unit: int, columns: tuple[int, ...]) -> Group:
    """The group with what is not in use of its unit."""
    if (members := candidates.rejected) is None:
        return group
    of_unit = members.unit == unit
    return replace(group, rejected=members.rows[of_unit], H_of_rejected=members.H[of_unit][:, :, list(columns)])


def _significant(
    adjusted: Adjusted, result: BundleResult, candidates: Candidates, alarm: float
) -> Iterator[_Significant]:
    """Score tests of all units, those that are beyond the limit."""
    alarm /= max(candidates.tests, len(candidates.units)) * len(candidates.causes)
    records, row = result.in_problem(candidates.place)
    least_gain = candidates.least_left * float(chdtri(candidates.H.shape[2], alarm))
    scores = score(adjusted, records, row[candidates.rows], candidates.H, candidates.unit, least_gain)
    for cause in candidates.causes:
        gain, rank = scores.gains(cause.columns)
        gain /= _variance(adjusted, gain, rank)
        gain /= _dispersion(candidates, gain, rank)
        for unit in np.flatnonzero((rank > 0) & (gain > chdtri(np.maximum(rank, 1), alarm))).tolist():
            yield _Significant(candidates, unit, cause, scores.joint(unit, cause.columns), float(gain[unit]), alarm)


def _variance(adjusted: Adjusted, gain: Float, rank: Int) -> Float:
    """Of unit weight with the parameters, at least 1."""
    redundancy, W = adjusted.redundancy - rank, adjusted.cost
    return np.maximum(1.0, np.where(redundancy > 0, (W - gain) / np.maximum(redundancy, 1), W / adjusted.redundancy))


def _dispersion(candidates: Candidates, gain: Float, rank: Int) -> Float:
    """How many times the gains of units like each are those of chance, (u,)."""
    if candidates.dispersion is not None:
        return candidates.dispersion
    common = 1.0 if candidates.typical is None else dispersion_of(gain[candidates.typical], int(rank.max(initial=0)))
    return np.full(len(gain), common)


def _group(block: BundleInput, adjusted: Adjusted, result: BundleResult, t: _Significant) -> Group:
    c, variance = t.candidates, float(_variance(adjusted, np.array(t.joint.gain), np.array(t.joint.rank)))
    unit_rows = np.flatnonzero(c.unit == t.unit)
    sigma = np.sqrt(np.diagonal(t.joint.covariance) * variance)
    kind = result.observations[c.place].observed.kind
    H, c_mm = c.H[unit_rows][:, :, list(t.cause.columns)], float("nan")
    if kind == IMAGE_POINT and block.rays is not None:
        c_mm = float(np.median(block.rays.c_mm[t.rows]))
    group = Group(
        c.place,
        kind,
        c.per,
        str(c.units[t.unit]),
        t.cause.name,
        t.rows,
        H,
        t.joint.value,
        sigma,
        t.gain,
        float(np.sqrt(variance)),
        c_mm=c_mm,
        loosens=t.cause.loosens,
        removable=c.removable,
    )
    return _with_rejected(group, c, t.unit, t.cause.columns)


def _confirmed(
    block: BundleInput,
    adjusted: Adjusted,
    result: BundleResult,
    t: _Significant,
    single: float,
) -> Group | None:
    """The group, if it does harm and is significant by the residuals of its kind, and beyond single observations."""
    group = _group(block, adjusted, result, t)
    if single and t.joint.gain < single**2 + SEPARABLE:
        return None
    change = moved(adjusted, result.observations[group.place].observed.records, group.rows, group.effect)
    group = with_change(block, result, group, change)
    if group.harm <= 1.0:
        return None
    before, after, scale = _residuals(adjusted, result, group, change)
    if t.gain / scale**2 <= chdtri(t.joint.rank, t.alarm):
        return None
    if group.per == MARK:
        return group
    if share_without_largest(before, after) < EXPLAINS or (
        single and not most_fit_better(before, after, absorbed=group.per == "camera")
    ):
        return None
    return _without_strangers(group, before, after) if group.per == NEIGHBOURHOOD else group


def _residuals(
    adjusted: Adjusted, result: BundleResult, group: Group, change: dict[str, Float]
) -> tuple[Float, Float, float]:
    """Whitened residuals of a group before and after it is carried; scale of its whole kind after, at least 1.

    Where the standard deviations of a kind are too small, all that its observations have in common is significant.
    """
    adjusted_kind = result.observations[group.place]
    records, rows = adjusted_kind.observed.records, np.flatnonzero(adjusted_kind.used)
    v, jacobians = whitened(records, adjusted.state, rows)
    effect = np.zeros((len(adjusted_kind.observed), records.rows))
    np.add.at(effect, group.rows, group.effect)
    after = v + times_whitener(records.whitener[rows], effect[rows], ())[0]
    for (name, block), J in zip(records.touches, jacobians):
        after += np.einsum("nmk,nk->nm", J, change[name][block[rows]])
    r = 1.0 - np.einsum("nii->ni", adjusted_kind.covariance[rows])
    w2 = (after**2)[tested := records.observed_components()[rows] & (r > CONTROLLED_COMPONENT)] / r[tested]
    scale = float(np.sqrt(max(1.0, np.median(w2) / float(chdtri(1.0, 0.5)) if len(w2) else 1.0)))
    return v[in_group := np.isin(rows, group.rows)], after[in_group], scale


def share_without_largest(before: Float, after: Float) -> float:
    """Share of what a group gains at its members that is not that of the one which gains most: of one alone it is 0."""
    gain = (before**2 - after**2).sum(axis=1)
    total = float(gain.sum())
    return 1.0 - float(gain.max(initial=0.0)) / total if total > 0 else 1.0


def most_fit_better(before: Float, after: Float, *, absorbed: bool = False) -> bool:
    """Whether a group explains most of its members; of a lens that most rays absorb, of more than three it changes."""
    change, gain = ((after - before) ** 2).sum(axis=1), (before**2 - after**2).sum(axis=1)
    better = gain[(not absorbed) | (change >= 0.5 * change.mean())] > 0
    return (not absorbed or len(better) > 3) and bool(better.mean() > 0.5 + 0.5 / np.sqrt(len(better)))


def _without_strangers(group: Group, before: Float, after: Float) -> Group:
    """Without the rows that fit much worse with it: a neighbourhood that was tested may hold some that did not move."""
    moved_too = (after**2).sum(axis=1) < (before**2).sum(axis=1) + SEPARABLE
    return replace(group, rows=group.rows[moved_too], H=group.H[moved_too])


def _with_alternatives(group: Group, equivalent: list[_Significant]) -> Group:
    """What else explains as much: other causes, and other units of the same kind, of each set of rows the best."""
    rows, alternatives = group.rows, list[tuple[str, str, str]]()
    for t in sorted(equivalent, key=lambda t: -t.gain):
        same_kind = (t.candidates.place, t.candidates.per) == (group.place, group.per)
        if same_kind and group.per != MARK and len(np.intersect1d(t.rows, rows)):
            continue
        alternatives.append((t.candidates.per, str(t.candidates.units[t.unit]), t.cause.name))
        rows = np.union1d(rows, t.rows) if same_kind else rows
    return replace(group, or_else=tuple(dict.fromkeys(alternatives)), undecided=np.setdiff1d(rows, group.rows))
