"""Start of a resection without approximate values: hypotheses of a few points, accepted where the others agree.

Three rays with known ground points P1 P2 P3 give the distances s1, s2 = u s1, s3 = v s1 from the projection centre by
Grunert's quartic in v; the orientation follows by turning the triangle of the image onto that of the ground. Several
well-spread triples are tried. Two points do where the projection centre is known, none where an orientation is offered.

A hypothesis of s points is accepted a contrario: with k of n points within e mm of where it sees them, points thrown
anywhere into an image of area A would be expected to agree as well

    NFA = T (n - s) C(n - s, k - s) (pi e^2 / A)^(k - s)

times in T hypotheses; the k with the least NFA counts, and that has to be below `ALARM`. So an image of points with
wrong numbers gets no orientation, however many they are, nor one of three points, which any triple fits.

Symbols: a, b, c the sides opposite P1, P2, P3; alpha, beta, gamma the angles between the rays opposite them.

Source: Grunert 1841, in the form of Haralick, Lee, Ottenberg and Noelle 1994; Moisan and Stival 2004 (a contrario).

Of many points the start comes from the direct linear transformation: eleven unknowns, no iteration.

    x = (L1 X + L2 Y + L3 Z + L4) / w,   y = (L5 X + L6 Y + L7 Z + L8) / w,   w = L9 X + L10 Y + L11 Z + L12

Six and more points, not in a plane, give the rows of the 3 x 4 matrix as the singular vector of least singular value of
the equations; coordinates are reduced to their means and to unit spread before (Hartley 1997). The matrix is
diag(-c, -c, 1) R' (I | -X0) up to a factor: the projection centre is its null vector; R comes from the other
columns with the known c, made orthogonal.

Source: Abdel-Aziz and Karara 1971; Hartley and Zisserman, Multiple View Geometry, 7.1.
"""

import itertools
from collections.abc import Iterator

import numpy as np
from scipy.special import gammaln

from aatri.adjustment.statistics.limits import ALARM
from aatri.arrays import Float
from aatri.geometry.collinearity import in_image_axes, project
from aatri.geometry.rotations import nearest_rotation
from aatri.geometry.vectors import unit
from aatri.orientation.resection.limits import (
    CLEARLY_WORSE,
    FEW_POINTS,
    FEWEST_LINEAR,
    FLAT_POINTS,
    LEAST_FITTING,
    OTHER_ORIENTATION,
    WIDE_RAD,
)

MAX_TRIPLES = 20

Orientation = tuple[Float, Float]
"""Projection centre (3,) in m, and rotation from image to ground (3, 3)."""


def linear_orientation(xy_mm: Float, c_mm: float, xyz_m: Float) -> tuple[Float, Float] | None:
    """Orientation of one image by the direct linear transformation.

    Parameters
    ----------
    xy_mm : (n, 2) float64, mm, from the principal point
    c_mm : float, mm
    xyz_m : (n, 3) float64, m

    Returns
    -------
    position_m : (3,) float64, m
    ground_from_image : (3, 3) float64
        None with fewer than six points, with points in a plane, or if points come out behind the camera.
    """
    if len(xy_mm) < FEWEST_LINEAR:
        return None
    centre = xyz_m.mean(axis=0)
    spread = np.linalg.svd(xyz_m - centre, compute_uv=False)
    if spread[2] <= FLAT_POINTS * spread[0]:
        return None
    size = float(np.linalg.norm(xyz_m - centre, axis=1).mean())
    X = np.column_stack([(xyz_m - centre) / size, np.ones(len(xyz_m))])
    ray = xy_mm / c_mm
    A = np.zeros((2 * len(X), 12))
    A[0::2, :4], A[0::2, 8:] = X, -ray[:, :1] * X
    A[1::2, 4:8], A[1::2, 8:] = X, -ray[:, 1:] * X
    P = np.linalg.svd(A)[2][-1].reshape(3, 4)
    homogeneous = np.linalg.svd(P)[2][-1]
    if abs(homogeneous[3]) < 1e-12:
        return None
    position = centre + size * homogeneous[:3] / homogeneous[3]
    turned = np.diag([-1.0, -1.0, 1.0]) @ P[:, :3]  # R' up to a factor
    rotation = nearest_rotation((turned * np.sign(np.linalg.det(turned))).T)
    if (in_image_axes(position[None], rotation[None], xyz_m)[:, 2] >= 0).any():
        return None
    return np.asarray(position), rotation


def start_orientation(
    xy_mm: Float,
    c_mm: float,
    xyz_m: Float,
    *,
    area_mm2: float | None = None,
    offered: Orientation | None = None,
    other_starts: tuple[tuple[int, Orientation], ...] = (),
) -> Orientation | None:
    """Orientation of one image from ground points, good enough to start a resection.

    Parameters
    ----------
    xy_mm : (n, 2) float64, mm, from the principal point
    c_mm : float, mm
    xyz_m : (n, 3) float64, m
    area_mm2 : float, optional
        Of the image; default: what its points cover.
    offered : Orientation, optional
        What else is known of it: both, the projection centre alone, or nothing where NaN.
    other_starts : tuple of (int, Orientation)
        Further hypotheses, and how many points each was made from.

    Returns
    -------
    position_m : (3,) float64, m
    ground_from_image : (3, 3) float64
        None if no orientation is accepted, or nothing tells two of them apart.
    """
    if not len(xy_mm):
        return None
    area = float(np.prod(np.ptp(xy_mm, axis=0))) if area_mm2 is None else area_mm2
    origin = xyz_m.mean(axis=0)
    ground = xyz_m - origin
    rays = unit(np.column_stack([xy_mm, np.full(len(xy_mm), -c_mm)]))
    offers = [(s, (position - origin, rotation)) for s, (position, rotation) in other_starts]
    if offered is not None and np.isfinite(offered[0]).all():
        centre = offered[0] - origin
        if np.isfinite(offered[1]).all():
            offers.append((0, (centre, offered[1])))
        offers += [(2, (centre, R)) for R in _turned(rays, ground - centre)]
    candidates = [
        *offers,
        *((3, pose) for triple in _triples(xy_mm) for pose in three_point(rays[triple], ground[triple])),
    ]
    judged = [(*_false_alarms(xy_mm, c_mm, ground, pose, s, len(candidates), area), pose) for s, pose in candidates]
    accepted = sorted((one for one in judged if one[0] < np.log(ALARM)), key=lambda one: one[:2])
    if not accepted:
        return None
    (_, size, best), rest = accepted[0], accepted[1:]
    if len(xy_mm) <= FEW_POINTS and any(
        e < CLEARLY_WORSE * size and _apart(best, other) > OTHER_ORIENTATION for _, e, other in rest
    ):
        return None
    return best[0] + origin, best[1]


def _false_alarms(
    xy: Float, c: float, ground: Float, pose: Orientation, s: int, trials: int, area: float
) -> tuple[float, float]:
    """Logarithm of the orientations expected to fit as well by chance, and how far off the fitting points are, mm."""
    u = in_image_axes(pose[0][None], pose[1][None], ground)
    with np.errstate(divide="ignore", invalid="ignore"):
        off = np.linalg.norm(project(u, np.full(len(u), c)) - xy, axis=1)
    n = len(off)
    off = np.sort(np.where((u[:, 2] < 0) & (off <= WIDE_RAD * c), off, np.inf))
    k = np.arange(max(s, int(np.ceil(LEAST_FITTING * n)) - 1), int(np.isfinite(off).sum())) + 1
    if not len(k):
        return np.inf, np.inf
    ways = gammaln(n - s + 1) - gammaln(k - s + 1) - gammaln(n - k + 1)
    alpha = np.minimum(np.pi * np.maximum(off[k - 1], 1e-9) ** 2 / max(area, 1e-9), 1.0)
    log = np.log(trials * (n - s)) + ways + (k - s) * np.log(alpha)
    best = int(np.argmin(log))
    return float(log[best]), float(off[k[best] - 1])


def _apart(one: Orientation, other: Orientation) -> float:
    """By how much two orientations differ, as a share of the distance to the points; these are about the origin."""
    return float(np.linalg.norm(one[0] - other[0]) / np.linalg.norm(one[0])) + float(np.abs(one[1] - other[1]).max())


def _turned(rays: Float, directions: Float) -> Iterator[Float]:
    """Rotations that bring two rays, far apart, onto the directions of their points."""
    d = unit(directions)
    pairs = np.array(list(itertools.combinations(range(len(rays)), 2)), dtype=np.int64).reshape(-1, 2)
    between = np.einsum("ni,ni->n", rays[pairs[:, 0]], rays[pairs[:, 1]])
    for a, b in pairs[np.argsort(between, kind="stable")[:MAX_TRIPLES]]:
        image = np.stack([rays[a], rays[b], np.cross(rays[a], rays[b])])
        yield nearest_rotation(np.stack([d[a], d[b], np.cross(d[a], d[b])]).T @ image)


def _triples(xy: Float) -> list[list[int]]:
    """The triples of largest area among the points farthest out, in a fixed order."""
    outer = np.argsort(-np.linalg.norm(xy - xy.mean(axis=0), axis=1), kind="stable")[:9]
    triples = [list(t) for t in itertools.combinations(sorted(outer), 3)]
    sides = [(xy[t[1]] - xy[t[0]], xy[t[2]] - xy[t[0]]) for t in triples]
    areas = np.array([abs(p[0] * q[1] - p[1] * q[0]) for p, q in sides])
    return [triples[k] for k in np.argsort(-areas, kind="stable")[:MAX_TRIPLES]]


def three_point(rays: Float, ground: Float) -> list[tuple[Float, Float]]:
    """All orientations that see three ground points along three rays.

    Parameters
    ----------
    rays : (3, 3) float64
        Unit vectors in the axes of the image.
    ground : (3, 3) float64

    Returns
    -------
    list of (position (3,), ground_from_image (3, 3))
    """
    a, b, c = (float(np.linalg.norm(ground[i] - ground[j])) for i, j in ((1, 2), (0, 2), (0, 1)))
    ca, cb, cg = (float(rays[i] @ rays[j]) for i, j in ((1, 2), (0, 2), (0, 1)))
    if min(a, b, c) == 0:
        return []
    p, q, r = (a**2 - c**2) / b**2, (a**2 + c**2) / b**2, c**2 / b**2
    quartic = [
        (p - 1) ** 2 - 4 * r * ca**2,
        4 * (p * (1 - p) * cb - (1 - q) * ca * cg + 2 * r * ca**2 * cb),
        2 * (p**2 - 1 + 2 * p**2 * cb**2 + 2 * (1 - r) * ca**2 - 4 * q * ca * cb * cg + 2 * (1 - a**2 / b**2) * cg**2),
        4 * (-p * (1 + p) * cb + 2 * a**2 / b**2 * cg**2 * cb - (1 - q) * ca * cg),
        (1 + p) ** 2 - 4 * a**2 / b**2 * cg**2,
    ]
    poses = []
    for root in np.roots(quartic):
        v = float(root.real)
        denominator = 2 * (cg - v * ca)
        if abs(root.imag) > 1e-4 * (1 + abs(v)) or v <= 0 or abs(denominator) < 1e-12:
            continue
        u = ((p - 1) * v**2 - 2 * p * cb * v + 1 + p) / denominator
        s1_squared = b**2 / (1 + v**2 - 2 * v * cb)
        if u > 0 and s1_squared > 0:
            s1 = np.sqrt(s1_squared)
            poses.append(_aligned(rays * np.array([s1, u * s1, v * s1])[:, None], ground))
    return poses


def _aligned(image: Float, ground: Float) -> tuple[Float, Float]:
    """Orientation that carries points in the axes of the image to the ground, least squares without scale."""
    mean_image, mean_ground = image.mean(axis=0), ground.mean(axis=0)
    rotation = nearest_rotation((ground - mean_ground).T @ (image - mean_image))
    return mean_ground - rotation @ mean_image, rotation
