"""What is to be said of an orientation: that it is weak or open, and by what critical configuration of its points.

- tiny base: the points are more than 50 bases away; short base: more than 25, where nothing else is found;
- corner: the points take up a small part of the model only;
- collinear: the model points lie near a line, so that they leave the turn about it open;
- critical cylinder: points and both projection centres lie on a circular cylinder whose axis is along the base, as the
  sides of a valley may; the right image can turn about the base and shift across it without y-parallax. Across the base
  the cylinder is a circle through the base: y^2 + z^2 = 2 a y + 2 b z.

Source: Hofmann 1953, Wunderlich 1941 (gefaehrliche Flaechen); Kraus, Photogrammetry 1, relative orientation.

Pairs whose points determine no orientation, whatever the start: too few points; the same coordinates in both images;
points on a line; images that differ by a rotation only (no base). Nearly all pairs are clearly free of these
(`plain_pairs`); the others are looked at one by one.

Source: docs/formulas.md 3.3.
"""

import numpy as np

from aatri.adjustment.threads import in_threads
from aatri.arrays import Bool, Float, Int
from aatri.errors import GeometryError
from aatri.geometry.coplanarity import RayPairs
from aatri.geometry.rotations import nearest_rotation
from aatri.geometry.vectors import tangents, unit
from aatri.ids import several
from aatri.orientation.relative.limits import (
    CIRCLE_BETTER,
    FAR_BASES,
    FLAT_DEPTH,
    IN_A_CORNER,
    LINE_SIGMAS,
    MANY_REJECTED,
    NO_BASE,
    ON_A_CIRCLE,
    ON_A_LINE,
    OPEN_RAD,
    SHORT_BASES,
    WEAK_RAD,
)

CLEARLY = 1.05
"""Factor by which bounds that call for a closer look are kept."""

PORTION = 200
"""Pairs that are judged together, whose points stay in the cache."""


GENERAL = "the points lie near a line, in a corner or on a critical surface"


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
        if across < LINE_SIGMAS * float(np.median(sigma)):
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
        clear &= across > CLEARLY * LINE_SIGMAS * np.maximum.reduceat(sigma.max(axis=1), first)
    u1, u2 = unit(rays.left), unit(rays.right)
    products = (u1[:, :, None] * u2[:, None, :]).reshape(-1, 9)
    turn = nearest_rotation(np.add.reduceat(products, first).reshape(-1, 3, 3)).reshape(-1, 9)
    cosine = np.einsum("nk,nk->n", products, turn[row])  # of the angles between left rays and right ones turned
    misfits = np.add.reduceat(1.0 - cosine**2 > (CLEARLY * NO_BASE * angle_sigmas(rays)) ** 2, first, dtype=np.int64)
    plain[plain] = clear & (2 * misfits > n)  # so is the median
    return plain


def critical_configuration(xyz: Float, base: Float) -> str:
    """What configuration the points have, as a clause; a general one where none of the named ones fits.

    Parameters
    ----------
    xyz : (n, 3) float64, bases
        Model points.
    base : (3,) float64, unit vector
    """
    if len(xyz) < 5 or not np.isfinite(xyz).all():
        return GENERAL
    distance = float(np.median(np.linalg.norm(xyz, axis=1)))
    if distance > FAR_BASES:
        return f"the base is tiny, 1/{distance:.0f} of the distance to the points"
    sizes = np.linalg.svd(xyz - xyz.mean(axis=0), compute_uv=False)
    if sizes[1] < ON_A_LINE * sizes[0]:
        return "the points lie near a line (collinear)"
    extent = float(np.ptp(xyz, axis=0).max())
    if extent < IN_A_CORNER:
        return f"the points lie in one small part of the model, {extent:.2f} bases wide (in a corner)"
    across = xyz @ tangents(base)
    centre = np.linalg.lstsq(2 * across, (across**2).sum(axis=1))[0]
    radius = float(np.linalg.norm(centre))
    off = np.linalg.norm(across - centre, axis=1) - radius
    spread = np.linalg.svd(across - across.mean(axis=0), compute_uv=False)
    apart, straight = float(np.sqrt((off**2).mean())), float(spread[1] / np.sqrt(len(xyz)))
    near = apart < ON_A_CIRCLE * float(np.ptp(across, axis=0).max()) and apart < CIRCLE_BETTER * straight
    if near and spread[1] > FLAT_DEPTH * spread[0]:
        return "points and projection centres lie near a circular cylinder along the base (critical cylinder)"
    return f"the base is short, 1/{distance:.0f} of the distance to the points" if distance > SHORT_BASES else GENERAL


def judged(
    covariance: Float, redundancy: int, sigma0: float, active: Bool, limit: float, xyz: Float, base: Float
) -> tuple[str, ...]:
    """What is to be said of an orientation; where it is weak or open, why, from its model points and base.

    Raises
    ------
    GeometryError
        If it is open.
    """
    texts = []
    largest = float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    if largest > OPEN_RAD:
        raise GeometryError(
            f"the orientation is open by {largest:.2g} rad: {critical_configuration(xyz[active], base)}",
            remedy="measure points over the whole overlap, at different heights",
        )
    if largest > WEAK_RAD:
        reason = critical_configuration(xyz[active], base)
        texts.append(f"weak geometry: the orientation is uncertain by {largest:.2g} rad; {reason}")
    if redundancy == 0:
        texts.append("exactly 5 points: no redundancy, nothing is checked")
    elif redundancy == 1 and sigma0 > limit:
        texts.append(
            f"sigma0 is {sigma0:.1f} with one redundant point: there is a gross error, but which point "
            "has it cannot be told"
        )
    rejected, n = int((~active).sum()), len(active)
    if n >= 10 and rejected > MANY_REJECTED * n:
        texts.append(f"{rejected} of {n} points are rejected: mismatches, or standard deviations that are too small")
    return tuple(texts)
