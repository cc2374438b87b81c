"""The compiled loops over pairs, in threads: adjustment with snooping from a given start, model points, statistics.

They take the pairs that are plain, their points clearly spread; what they cannot orient is left to the caller.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from aatri.adjustment.threads import in_threads, items_between
from aatri.arrays import Bool, Float, Int
from aatri.errors import GeometryError
from aatri.geometry.coplanarity import RayPairs
from aatri.geometry.intersection import inverse_of_normals
from aatri.geometry.rotations import nearest_rotation
from aatri.orientation.relative.dependent import MANY_REJECTED, WEAK_RAD, judged
from aatri.orientation.relative.kernels.model_points import intersect
from aatri.orientation.relative.kernels.snooping import snoop
from aatri.orientation.relative.pair_adjustment import BEHIND, ENOUGH, FALLBACKS, SNOOPED
from aatri.orientation.relative.start import LINE, NO_BASE
from aatri.progress import Reporter

AT_ONCE = 500_000
"""Points of the pairs that are worked on together; bounds the memory."""

WORTH_A_THREAD = 1_000
"""Points for which a thread of their own pays."""

CLEARLY = 1.05
"""Factor by which bounds that call for a closer look are kept."""


@dataclass(frozen=True)
class RelativeOrientations:
    """Relative orientations of pairs, and their models; see `dependent.RelativeOrientation`.

    Attributes
    ----------
    formed : (m,) bool
        The rows of the other pairs are NaN and 0.
    left_from_right, base, covariance, sigma0 : (m, 3, 3), (m, 3), (m, 5, 5), (m,) float64
    redundancy, iterations : (m,) int64
    active : (n,) bool
    parallax_mm, error_mm, error_sigma_mm, test : (n,) float64
    xyz, point_covariance, depth : (n, 3), (n, 3, 3), (n, 2) float64
        Model points.
    reasons : dict
        Why a pair makes no model, by pair.
    warnings : dict
        Of formed pairs, by pair.
    scale : float
        What the standard deviations of the image points were multiplied by, see `image_scale`; covariances, tests and
        errors are with it, sigma0 is not.
    """

    formed: Bool
    left_from_right: Float
    base: Float
    covariance: Float
    sigma0: Float
    redundancy: Int
    iterations: Int
    active: Bool
    parallax_mm: Float
    error_mm: Float
    error_sigma_mm: Float
    test: Float
    xyz: Float
    point_covariance: Float
    depth: Float
    reasons: dict[int, str] = field(default_factory=dict)
    warnings: dict[int, tuple[str, ...]] = field(default_factory=dict)
    scale: float = 1.0


@dataclass(frozen=True)
class Portion:
    """Pairs that are worked on together: what a start is made of, and filled in.

    Attributes
    ----------
    first, last : int
        These pairs of all, the last excluded.
    rays : RayPairs
    table : (n, 10) float64
        The rays as the compiled loops take them.
    chosen : (m,) bool
    pose : (m, 3, 4) float64
        Filled in.
    active : (n,) bool
        Points to begin with; changed.
    all_pairs : callable
        Runs a compiled loop with its arguments, shared out among threads.
    """

    first: int
    last: int
    rays: RayPairs
    table: Float
    chosen: Bool
    pose: Float
    active: Bool
    all_pairs: Callable[..., None]


Begin = Callable[[Portion], None]


def oriented_in_loops(
    rays: RayPairs, start: Int, begin: Begin, snooping_limit: float, max_iterations: int, min_points: int,
    reporter: Reporter, *, enough: float = ENOUGH,
) -> RelativeOrientations:  # fmt: skip
    """What the compiled loops can orient; the other pairs have neither orientation nor reason, unless they are open.

    `enough` is the share of the points that has to fit; a smaller one suffices where the start is already the best of
    many.
    """
    found = _nothing(len(start) - 1, len(rays.left))
    for first, last in _portions(start):
        reporter.progress(first, len(start) - 1, "models")
        _orient(found, rays, start, first, last, begin, snooping_limit, max_iterations, min_points, enough)
    _judge(found, np.flatnonzero(found.formed), start, snooping_limit)
    return found


def _nothing(m: int, n: int) -> RelativeOrientations:
    nan = np.nan
    return RelativeOrientations(
        np.zeros(m, dtype=bool), np.full((m, 3, 3), nan), np.full((m, 3), nan), np.full((m, 5, 5), nan),
        np.full(m, nan), np.zeros(m, dtype=np.int64), np.zeros(m, dtype=np.int64), np.zeros(n, dtype=bool),
        np.full(n, nan), np.full(n, nan), np.full(n, nan), np.full(n, nan), np.full((n, 3), nan),
        np.full((n, 3, 3), nan), np.full((n, 2), nan),
    )  # fmt: skip


def _portions(start: Int) -> list[tuple[int, int]]:
    """Runs of pairs with some `AT_ONCE` points."""
    pieces = max(round(int(start[-1]) / AT_ONCE), 1)
    bounds = np.searchsorted(start[:-1], np.linspace(0, start[-1], pieces + 1)[1:-1])
    edges = np.unique(np.concatenate([[0], bounds, [len(start) - 1]])).tolist()
    return list(pairwise(edges))


def _orient(
    found: RelativeOrientations, all_rays: RayPairs, all_start: Int, first: int, last: int,
    begin: Begin, limit: float, max_iterations: int, min_points: int, enough: float,
) -> None:  # fmt: skip
    """The compiled loops over the pairs first ... last - 1; what they orient is filled in."""
    rows = slice(int(all_start[first]), int(all_start[last]))
    start = np.ascontiguousarray(all_start[first : last + 1] - rows.start, dtype=np.int64)
    rays, m, n = all_rays.take(np.arange(rows.start, rows.stop)), last - first, rows.stop - rows.start
    table = np.concatenate([rays.left, rays.right, rays.left_sigma**2, rays.right_sigma**2], axis=1)
    plain = plain_pairs(rays, start, max(min_points, SNOOPED))
    pose, W, iterations = np.full((m, 3, 4), np.nan), np.full((m, 5, 5), np.nan), np.zeros(m, dtype=np.int64)
    inside, active = np.ones(n, dtype=bool), np.ones(n, dtype=bool)
    work, model = np.full((n, 9), np.nan), np.full((n, 15), np.nan)
    row = np.repeat(np.arange(m), np.diff(start))

    def all_pairs(loop: Callable[..., None], *arguments: object) -> None:
        in_threads(n, lambda a, b: loop(*items_between(start, a, b), start, *arguments), worth=WORTH_A_THREAD)

    chosen, settled = plain.copy(), np.zeros(m, dtype=bool)
    begin(Portion(first, last, rays, table, chosen, pose, active, all_pairs))
    for _ in range(FALLBACKS):  # points behind an image are taken out, and it is adjusted again
        all_pairs(snoop, table, chosen, limit, max_iterations, pose, W, iterations, inside, active, work)
        chosen &= iterations > 0
        all_pairs(intersect, chosen, pose, table, model)
        newly = active & chosen[row] & ~(model[:, 12:14] > 0).all(axis=1)
        active[newly] = inside[newly] = False
        hit = np.bincount(row[newly], minlength=m) > 0
        settled |= chosen & ~hit
        chosen = chosen & hit & (np.bincount(row[active], minlength=m) >= 5)
        chosen &= np.bincount(row[inside], minlength=m) >= SNOOPED
        if not chosen.any():
            break
    settled &= np.bincount(row[~inside], minlength=m) <= BEHIND * np.bincount(row, minlength=m)
    settled = _good(settled, row, work, active, limit, min_points, enough)
    work[~settled[row]] = np.nan
    done = np.flatnonzero(settled)
    of_done = first + done
    found.formed[of_done] = True
    found.left_from_right[of_done], found.base[of_done] = pose[done, :, :3], pose[done, :, 3]
    found.covariance[of_done], found.iterations[of_done] = W[done].swapaxes(1, 2) @ W[done], iterations[done]
    found.redundancy[of_done] = redundancy = np.bincount(row[active], minlength=m)[done] - 5
    square = np.bincount(row[active], work[active, 0] ** 2, minlength=m)[done]
    found.sigma0[of_done] = np.sqrt(square / np.where(redundancy > 0, redundancy, np.nan))
    _fill_points(found, rows, settled[row], active, work, model)


def _good(settled: Bool, row: Int, work: Float, active: Bool, limit: float, min_points: int, enough: float) -> Bool:
    """Pairs of which enough points fit, so that no other start is tried and a model is formed."""
    m = len(settled)
    n, used = np.bincount(row, minlength=m), np.bincount(row[active], minlength=m)
    size = np.abs(work[:, 0])
    below = np.bincount(row[size <= limit], minlength=m)
    near = 2 * below > n
    for pair in np.flatnonzero(settled & (2 * below == n)).tolist():  # the median is between the middle two
        near[pair] = np.median(size[row == pair]) <= limit
    misfits = np.bincount(row[active & (work[:, 6] > limit)], minlength=m)
    fits = ((misfits == 0) | (used <= 6)) & (used >= ENOUGH * n)
    finite = np.bincount(row[~np.isfinite(size)], minlength=m) == 0
    return np.asarray(settled & finite & (near | fits) & (used >= max(min_points, 5)) & (used >= enough * n))


def _fill_points(
    found: RelativeOrientations, rows: slice, of_done: Bool, active: Bool, work: Float, model: Float
) -> None:
    v, test, r, sigma = work[:, 0], work[:, 6], work[:, 7], work[:, 8]
    covariance = model[:, 3:12].reshape(-1, 3, 3)
    doubtful = np.flatnonzero(of_done & (model[:, 14] > 0))
    covariance[doubtful] = inverse_of_normals(covariance[doubtful])
    root = np.sqrt(r)
    found.active[rows] = active & of_done
    for column, values in (
        (found.parallax_mm, -v * sigma),
        (found.error_mm, np.where(active, -v * sigma / r, np.where(np.isnan(r), np.nan, -v * sigma))),
        (found.error_sigma_mm, np.where(active, sigma / root, sigma * root)),
        (found.test, test),
    ):
        column[rows] = np.where(of_done, values, np.nan)
    for table, values in ((found.xyz, model[:, :3]), (found.depth, model[:, 12:14])):
        table[rows] = np.where(of_done[:, None], values, np.nan)
    found.point_covariance[rows] = np.where(of_done[:, None, None], covariance, np.nan)


def plain_pairs(rays: RayPairs, start: Int, fewest: int) -> Bool:
    """Pairs without any of the defects that `start.refuse_degenerate` looks for, clearly."""
    n = np.diff(start)
    plain = np.asarray(n >= fewest)
    if not plain.any():
        return plain
    rays = rays.take(np.repeat(plain, n))
    n = n[plain]
    first = np.concatenate([[0], np.cumsum(n)[:-1]])
    row = np.repeat(np.arange(len(n)), n)
    clear = np.logical_or.reduceat((rays.left[:, :2] != rays.right[:, :2]).any(axis=1), first)
    for u, sigma in ((rays.left, rays.left_sigma), (rays.right, rays.right_sigma)):
        d = u[:, :2] - (np.add.reduceat(u[:, :2], first) / n[:, None])[row]
        xx, xy, yy = np.add.reduceat(np.column_stack([d[:, 0] ** 2, d[:, 0] * d[:, 1], d[:, 1] ** 2]), first).T
        across = np.sqrt(np.maximum(0.5 * (xx + yy - np.hypot(xx - yy, 2 * xy)), 0.0) / n)
        clear &= across > CLEARLY * LINE * np.maximum.reduceat(sigma.max(axis=1), first)
    length_1, length_2 = np.linalg.norm(rays.left, axis=1), np.linalg.norm(rays.right, axis=1)
    u1, u2 = rays.left / length_1[:, None], rays.right / length_2[:, None]
    moment = np.add.reduceat((u1[:, :, None] * u2[:, None, :]).reshape(-1, 9), first).reshape(-1, 3, 3)
    turned = np.einsum("nij,nj->ni", nearest_rotation(moment)[row], u2)
    sine = np.linalg.norm(np.cross(u1, turned), axis=1)
    sigma_angle = np.hypot(rays.left_sigma.mean(axis=1) / length_1, rays.right_sigma.mean(axis=1) / length_2)
    misfits = np.add.reduceat((sine > CLEARLY * NO_BASE * sigma_angle).astype(np.int64), first)
    plain[plain] = clear & (2 * misfits > n)  # so is the median
    return plain


def _judge(found: RelativeOrientations, pairs: Int, start: Int, limit: float) -> None:
    """Warnings of the pairs of the compiled loop; those that are open make no model."""
    largest = np.sqrt(np.linalg.eigvalsh(found.covariance[pairs])[:, -1]) if len(pairs) else np.zeros(0)
    n = np.diff(start)[pairs]
    rejected = n - found.redundancy[pairs] - 5
    doubtful = (largest > 0.99 * WEAK_RAD) | (found.redundancy[pairs] <= 1) | (rejected > MANY_REJECTED * n)
    for pair in pairs[doubtful].tolist():
        rows = slice(int(start[pair]), int(start[pair + 1]))
        active, xyz = found.active[rows], found.xyz[rows]
        try:
            texts = judged(
                found.covariance[pair],
                int(found.redundancy[pair]),
                float(found.sigma0[pair]),
                active,
                limit,
                xyz,
                found.base[pair],
            )
        except GeometryError as error:
            found.formed[pair] = False
            found.reasons[pair] = error.what
        else:
            found.warnings[pair] = texts
