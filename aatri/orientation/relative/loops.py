"""Relative orientations of many pairs by compiled loops, in threads, from one start after the other.

A pair is adjusted from a start, with data snooping; points that come to lie behind an image are taken out and it is
adjusted again. A solution is good where enough points fit and few lie behind: no other start is tried then. Else the
best of all starts counts, that with most points and of these the one with the least squares.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from aatri.adjustment.threads import in_threads, items_between
from aatri.arrays import Bool, Float, Int
from aatri.errors import GeometryError
from aatri.geometry.coplanarity import RayPairs
from aatri.orientation.relative.by_chance import fit_by_chance
from aatri.orientation.relative.critical import critical_configuration, degenerate_pairs, judged
from aatri.orientation.relative.kernels.model_points import intersect
from aatri.orientation.relative.kernels.sampson import OPEN
from aatri.orientation.relative.kernels.snooping import snoop
from aatri.orientation.relative.kernels.start import parallel_starts
from aatri.orientation.relative.limits import BEHIND_SHARE, ENOUGH_FIT, LEAST_SHARE_OF_MODEL, MANY_REJECTED, WEAK_RAD
from aatri.orientation.relative.orientations import PairSettings, RelativeOrientations, rows_of_pairs
from aatri.progress import Reporter

AT_ONCE = 500_000
"""Points of the pairs that are worked on together; bounds the memory."""

WORTH_A_THREAD = 1_000
"""Points for which a thread of their own pays."""

FALLBACKS = 3
"""Adjustments in all, while points fall behind an image."""


@dataclass(frozen=True)
class Portion:
    """Pairs that are worked on together: what a start is made of, and filled in."""

    pair: Int
    """(m,). Which of all pairs they are."""
    count: Int
    """(m,). Points of each."""
    rays: RayPairs
    table: Float
    """(n, 10). The rays as the compiled loops take them."""
    chosen: Bool
    """(m,). Changed: pairs without a start."""
    pose: Float
    """(m, 3, 4). Filled in."""
    active: Bool
    """(n,). Points to begin with; changed."""
    reasons: dict[int, str]
    """Filled in: why a pair makes no model, by `pair`, should the loops find nothing that fits."""
    all_pairs: Callable[..., None]
    """Runs a compiled loop with its arguments, shared out among threads."""


Start = Callable[[Portion], None]


def from_parallel(portion: Portion) -> None:
    """Start pairs as parallel images."""
    rays = portion.rays
    q = np.column_stack([rays.left[:, :2] / -rays.left[:, 2:], rays.right[:, :2] / -rays.right[:, 2:]])
    portion.all_pairs(parallel_starts, q, portion.chosen, portion.pose)


@dataclass(frozen=True)
class AdjustedPairs:
    """Pairs adjusted from one start."""

    orientations: RelativeOrientations
    """`formed` where the adjustment ended with points in front of both images."""
    good: Bool
    """(m,). Enough points fit: another start cannot do much better."""
    squares: Float
    """(m,). Of the residuals."""


def oriented_from(
    rays: RayPairs, start: Int, starts: Sequence[tuple[Start, float]], settings: PairSettings, reporter: Reporter
) -> RelativeOrientations:
    """Orientations of all pairs, from one start after the other.

    Parameters
    ----------
    rays, start, reporter
        As of `pairs.relative_orientations`.
    starts : sequence of (callable, float)
        How pairs begin, and the share of the points that has to fit for the solution to be a good one.
    """
    m, count, fewest = len(start) - 1, np.diff(start), max(settings.min_points, 5)
    reasons = degenerate_pairs(rays, start, fewest)
    todo = np.array([pair not in reasons for pair in range(m)], dtype=bool)
    orientations, squares = RelativeOrientations.empty(m, len(rays.left)), np.full(m, np.inf)
    for begin, enough in starts:
        pairs = np.flatnonzero(todo)
        if not len(pairs):
            break
        rows, own_start = rows_of_pairs(start, pairs), np.concatenate([[0], np.cumsum(count[pairs])])
        part = rays if len(pairs) == m else rays.take(rows)
        adjusted = _adjusted_from(part, own_start, pairs, begin, enough, settings, reporter)
        used, before = adjusted.orientations.redundancy, orientations.redundancy[pairs]
        better = (used > before) | (used == before) & (adjusted.squares < squares[pairs])
        better = adjusted.orientations.formed & (better | ~orientations.formed[pairs])
        own = np.flatnonzero(better)
        if len(own) == m:
            orientations = adjusted.orientations
        else:
            orientations.put(
                pairs[own],
                rows[np.repeat(better, count[pairs])],
                adjusted.orientations,
                own,
                rows_of_pairs(own_start, own),
            )
        squares[pairs[own]] = adjusted.squares[own]
        reasons |= adjusted.orientations.reasons
        todo[pairs[adjusted.good]] = False
    used = np.where(orientations.formed, orientations.redundancy + 5, 0)
    too_few = (used < fewest) | (used < LEAST_SHARE_OF_MODEL * count) | fit_by_chance(rays, start, used, settings.limit)
    few = np.flatnonzero(orientations.formed & too_few)
    reasons |= {pair: f"only {used[pair]} of {count[pair]} points fit one orientation" for pair in few.tolist()}
    orientations.put(few, rows_of_pairs(start, few), RelativeOrientations.empty(1, 1), 0, 0)
    orientations.reasons.clear()
    orientations.reasons.update({pair: text for pair, text in reasons.items() if not orientations.formed[pair]})
    _judge(orientations, start, settings.limit)
    for pair in np.flatnonzero(~orientations.formed).tolist():
        orientations.reasons.setdefault(pair, "no relation between the images fits one orientation")
    return orientations


def _adjusted_from(
    rays: RayPairs, start: Int, pairs: Int, begin: Start, enough: float, settings: PairSettings, reporter: Reporter
) -> AdjustedPairs:
    """The given pairs adjusted from one start, portion by portion."""
    m = len(pairs)
    adjusted = AdjustedPairs(RelativeOrientations.empty(m, len(rays.left)), np.zeros(m, dtype=bool), np.full(m, np.inf))
    pieces = max(round(int(start[-1]) / AT_ONCE), 1)
    bounds = np.searchsorted(start[:-1], np.linspace(0, start[-1], pieces + 1)[1:-1])
    for first, last in pairwise(np.unique(np.concatenate([[0], bounds, [m]])).tolist()):
        reporter.progress(first, m, "models")
        rows = slice(int(start[first]), int(start[last]))
        own = np.ascontiguousarray(start[first : last + 1] - rows.start, dtype=np.int64)
        _adjust_portion(
            adjusted, slice(first, last), rows, rays.take(rows), own, pairs[first:last], begin, enough, settings
        )
    return adjusted


def _adjust_portion(
    adjusted: AdjustedPairs,
    portion: slice,
    rows: slice,
    rays: RayPairs,
    start: Int,
    pairs: Int,
    begin: Start,
    enough: float,
    settings: PairSettings,
) -> None:
    """The compiled loops over some of the pairs, those of `portion` with the points of `rows`."""
    m, n, count = len(pairs), len(rays.left), np.diff(start)
    table = np.concatenate([rays.left, rays.right, rays.left_sigma**2, rays.right_sigma**2], axis=1)
    pose, W, iterations = np.full((m, 3, 4), np.nan), np.full((m, 5, 5), np.nan), np.zeros(m, dtype=np.int64)
    inside, active = np.ones(n, dtype=bool), np.ones(n, dtype=bool)
    work, model = np.full((n, 9), np.nan), np.full((n, 14), np.nan)
    row, limit = np.repeat(np.arange(m), count), settings.limit

    def all_pairs(loop: Callable[..., None], *arguments: object) -> None:
        in_threads(n, lambda a, b: loop(*items_between(start, a, b), start, *arguments), worth=WORTH_A_THREAD)

    chosen, settled = np.ones(m, dtype=bool), np.zeros(m, dtype=bool)
    begin(Portion(pairs, count, rays, table, chosen, pose, active, adjusted.orientations.reasons, all_pairs))
    for _ in range(FALLBACKS):  # points behind an image are taken out, and it is adjusted again
        all_pairs(snoop, table, chosen, limit, settings.max_iterations, pose, W, iterations, inside, active, work)
        all_pairs(intersect, chosen, pose, table, model)
        chosen &= iterations > 0
        newly = active & chosen[row] & ~(model[:, 12:14] > 0).all(axis=1)
        active[newly] = inside[newly] = False
        hit = np.bincount(row[newly], minlength=m) > 0
        settled |= chosen & ~hit
        chosen &= hit & (np.bincount(row[active], minlength=m) >= 5)
        if not chosen.any():
            break
    settled &= np.bincount(row[~np.isfinite(work[:, 0])], minlength=m) == 0
    used = np.bincount(row[active], minlength=m)
    few_behind = np.bincount(row[~inside], minlength=m) <= BEHIND_SHARE * count
    fits = _fits(settled, row, work, active, limit, enough) & (used >= max(settings.min_points, 5))
    adjusted.good[portion] = settled & few_behind & fits
    near = 2 * np.bincount(row[np.abs(work[:, 0]) <= limit], minlength=m) > count
    for pair in np.flatnonzero(near & (iterations <= 0) & ~settled).tolist():
        what = "its points do not determine an orientation" if iterations[pair] == OPEN else "it does not converge"
        reason = critical_configuration(model[row == pair, :3], pose[pair, :, 3])
        adjusted.orientations.reasons[int(pairs[pair])] = f"{what}: {reason}"
    work[~settled[row]] = np.nan
    done, orientations = np.flatnonzero(settled), adjusted.orientations
    of_done = portion.start + done
    orientations.formed[of_done] = True
    orientations.left_from_right[of_done], orientations.base[of_done] = pose[done, :, :3], pose[done, :, 3]
    orientations.covariance[of_done], orientations.iterations[of_done] = (
        W[done].swapaxes(1, 2) @ W[done],
        iterations[done],
    )
    orientations.redundancy[of_done] = redundancy = used[done] - 5
    adjusted.squares[of_done] = square = np.bincount(row[active], work[active, 0] ** 2, minlength=m)[done]
    orientations.sigma0[of_done] = np.sqrt(square / np.where(redundancy > 0, redundancy, np.nan))
    _fill_points(orientations, rows, settled[row], active, work, model)


def _fits(settled: Bool, row: Int, work: Float, active: Bool, limit: float, enough: float) -> Bool:
    """Pairs of which enough points fit.

    Standard deviations that are too small leave misfits everywhere; another start would not mend that. But where most
    points had to go, those left can fit an orientation that is wrong altogether.
    """
    m = len(settled)
    n, used = np.bincount(row, minlength=m), np.bincount(row[active], minlength=m)
    size = np.abs(work[:, 0])
    below = np.bincount(row[size <= limit], minlength=m)
    near = 2 * below > n
    for pair in np.flatnonzero(settled & (2 * below == n)).tolist():  # the median is between the middle two
        near[pair] = np.median(size[row == pair]) <= limit
    misfits = np.bincount(row[active & (work[:, 6] > limit)], minlength=m)
    fits = ((misfits == 0) | (used <= 6)) & (used >= ENOUGH_FIT * n)
    return np.asarray((near | fits) & (used >= enough * n))


def _fill_points(
    orientations: RelativeOrientations, rows: slice, of_done: Bool, active: Bool, work: Float, model: Float
) -> None:
    v, test, r, sigma = work[:, 0], work[:, 6], work[:, 7], work[:, 8]
    root = np.sqrt(r)
    orientations.active[rows] = active & of_done
    for column, values in (
        (orientations.parallax_mm, -v * sigma),
        (orientations.error_mm, np.where(active, -v * sigma / r, np.where(np.isnan(r), np.nan, -v * sigma))),
        (orientations.error_sigma_mm, np.where(active, sigma / root, sigma * root)),
        (orientations.test, test),
    ):
        column[rows] = np.where(of_done, values, np.nan)
    for table, values in ((orientations.xyz, model[:, :3]), (orientations.depth, model[:, 12:14])):
        table[rows] = np.where(of_done[:, None], values, np.nan)
    orientations.point_covariance[rows] = np.where(of_done[:, None, None], model[:, 3:12].reshape(-1, 3, 3), np.nan)


def _judge(orientations: RelativeOrientations, start: Int, limit: float) -> None:
    """Warnings of the pairs; those that are open make no model."""
    pairs = np.flatnonzero(orientations.formed)
    largest = np.sqrt(np.linalg.eigvalsh(orientations.covariance[pairs])[:, -1]) if len(pairs) else np.zeros(0)
    n = np.diff(start)[pairs]
    rejected = n - orientations.redundancy[pairs] - 5
    doubtful = (largest > 0.99 * WEAK_RAD) | (orientations.redundancy[pairs] <= 1) | (rejected > MANY_REJECTED * n)
    for pair in pairs[doubtful].tolist():
        rows = slice(int(start[pair]), int(start[pair + 1]))
        try:
            orientations.warnings[pair] = judged(
                orientations.covariance[pair],
                int(orientations.redundancy[pair]),
                float(orientations.sigma0[pair]),
                orientations.active[rows],
                limit,
                orientations.xyz[rows],
                orientations.base[pair],
            )
        except GeometryError as error:
            orientations.formed[pair] = False
            orientations.reasons[pair] = error.what
