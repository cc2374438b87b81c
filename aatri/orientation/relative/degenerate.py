"""Pairs whose points determine no orientation, whatever the start.

Too few points; the same coordinates in both images; points on a line; images that differ by a rotation only (no base).
Nearly all pairs are clearly free of these (`plain_pairs`); the others are looked at one by one.

Source: docs/formulas.md 3.3.
"""

import numpy as np

from aatri.adjustment.threads import in_threads
from aatri.arrays import Bool, Float, Int
from aatri.geometry.coplanarity import RayPairs
from aatri.geometry.rotations import nearest_rotation
from aatri.geometry.vectors import unit
from aatri.ids import several

LINE = 3.0
"""Points lie on a line if they are no farther from it than this many standard deviations, root mean square."""

NO_BASE = 2.0
"""There is no base if a rotation alone fits within this many standard deviations, in the median."""

CLEARLY = 1.05
"""Factor by which bounds that call for a closer look are kept."""

PORTION = 200
"""Pairs that are judged together, whose points stay in the cache."""


def degenerate_pairs(rays: RayPairs, start: Int, fewest: int) -> dict[int, str]:
    """Why pairs have no orientation, by pair.

    Parameters
    ----------
    rays, start
        As of `pairs.relative_orientations`.
    fewest : int
        Points of a pair.
    """
    reasons = {}
    for pair in np.flatnonzero(~plain_pairs(rays, start, fewest)).tolist():
        reason = _defect(rays.take(slice(int(start[pair]), int(start[pair + 1]))), fewest)
        if reason:
            reasons[pair] = reason
    return reasons


def _defect(rays: RayPairs, fewest: int) -> str:
    n = len(rays.left)
    if n < fewest:
        return f"{several(n, 'common point')}, {fewest} are needed"
    if np.array_equal(rays.left[:, :2], rays.right[:, :2]):
        return "identical coordinates in both images"
    for side, u, sigma in (("left", rays.left, rays.left_sigma), ("right", rays.right, rays.right_sigma)):
        across = np.linalg.svd(u[:, :2] - u[:, :2].mean(axis=0), compute_uv=False)[1] / np.sqrt(n)
        if across < LINE * float(np.median(sigma)):
            return f"all points lie on a line in the {side} image"
    u1, u2 = unit(rays.left), unit(rays.right)
    sine = np.linalg.norm(np.cross(u1, u2 @ nearest_rotation(u1.T @ u2).T), axis=1)
    return "no base: a rotation alone explains the images" if np.median(sine / angle_sigmas(rays)) < NO_BASE else ""


def angle_sigmas(rays: RayPairs) -> Float:
    """Standard deviations of the angles between the rays of both images, (n,) rad."""
    left, right = np.linalg.norm(rays.left, axis=1), np.linalg.norm(rays.right, axis=1)
    return np.asarray(np.hypot(rays.left_sigma.mean(axis=1) / left, rays.right_sigma.mean(axis=1) / right))


def plain_pairs(rays: RayPairs, start: Int, fewest: int) -> Bool:
    """Pairs without any of the defects, clearly."""
    plain = np.diff(start) >= fewest
    portions = [plain[k : k + PORTION] for k in range(0, len(plain), PORTION)]  # views, to be filled

    def judge(first: int, last: int) -> None:
        for k in range(first, last):
            of_portion = start[k * PORTION : (k + 1) * PORTION + 1]
            rows = slice(int(of_portion[0]), int(of_portion[-1]))
            portions[k][:] = _plain_pairs(rays.take(rows), of_portion - of_portion[0], portions[k])

    in_threads(len(portions), judge, worth=1)
    return plain


def _plain_pairs(rays: RayPairs, start: Int, enough: Bool) -> Bool:
    """The same of those with enough points, all at once."""
    n, plain = np.diff(start), enough.copy()
    if not plain.any():
        return plain
    if not plain.all():
        rays, n = rays.take(np.repeat(plain, n)), n[plain]
    first = np.concatenate([[0], np.cumsum(n)[:-1]])
    row = np.repeat(np.arange(len(n)), n)
    clear = np.logical_or.reduceat((rays.left[:, :2] != rays.right[:, :2]).any(axis=1), first)
    for u, sigma in ((rays.left, rays.left_sigma), (rays.right, rays.right_sigma)):
        d = u[:, :2] - (np.add.reduceat(u[:, :2], first) / n[:, None])[row]
        xx, xy, yy = np.add.reduceat(np.column_stack([d[:, 0] ** 2, d[:, 0] * d[:, 1], d[:, 1] ** 2]), first).T
        across = np.sqrt(np.maximum(0.5 * (xx + yy - np.hypot(xx - yy, 2 * xy)), 0.0) / n)
        clear &= across > CLEARLY * LINE * np.maximum.reduceat(sigma.max(axis=1), first)
    u1, u2 = unit(rays.left), unit(rays.right)
    products = (u1[:, :, None] * u2[:, None, :]).reshape(-1, 9)
    turn = nearest_rotation(np.add.reduceat(products, first).reshape(-1, 3, 3)).reshape(-1, 9)
    cosine = np.einsum("nk,nk->n", products, turn[row])  # of the angles between left rays and right ones turned
    misfits = np.add.reduceat(1.0 - cosine**2 > (CLEARLY * NO_BASE * angle_sigmas(rays)) ** 2, first, dtype=np.int64)
    plain[plain] = clear & (2 * misfits > n)  # so is the median
    return plain
