"""Ground points against the terrain around them: what two rays alone determine, no test of rays can judge.

A gross error along the base of two rays only moves their point, mostly in height. The terrain around each point is a
plane through its nearest neighbours in plan, by least absolute deviations (weights 1 / |r|, repeated),

    Z = a + b (X - X_i) + c (Y - Y_i),      t = |Z_i - a| / sqrt(s^2 (1 + q) + sigma_Z^2)

q the cofactor of a; s the roughness of the terrain, 1.4826 times the median |Z_j - a_j| of points with three rays and
more, or of the neighbours where that is larger; where these are farther away than usual it grows with the square of
their distance, as a plane departs from a curved surface. A point of two rays is doubtful where t exceeds the limit of a
normal deviate at `ALARM` over the number of points, and `LONGER_EDGE` times the largest t of the points with three
rays: breaklines and houses have longer tails than a normal distribution, and those points, which their rays have
tested, show how long. One that its neighbours do not surround, q > `SURROUNDED`, is held against the heights of all
points with three rays, and doubtful where it lies `BEYOND_TERRAIN` of the flying height, and the limit times sigma_Z,
above or below them; not where these spread by more than the flying height, as around an object at close range. A point
with more rays is doubtful only where it also lies off by `FAR_FROM_TERRAIN` of the flying height, as no terrain does.

Source: Kraus, Photogrammetry, on filtering points against a local surface; docs/methods/gross_errors.md.
"""

from dataclasses import dataclass

import numpy as np

from aatri.adjustment.statistics.limits import ALARM, limit_of_tests
from aatri.arrays import Float, Int, finite_rows
from aatri.orientation.bundle.limits import BEYOND_TERRAIN, FAR_FROM_TERRAIN, LEAST_DOWNWARDS, LONGER_EDGE, SURROUNDED

NEIGHBOURS, FEWEST, ITERATIONS = 12, 30, 5
"""Neighbours of a point; points with three rays below which there is no terrain; rounds until the plane has settled."""

MOST = 50_000
"""Points of three rays and more, evenly taken, from which the roughness is found."""


@dataclass(frozen=True)
class OffTerrain:
    """Points against the terrain around them."""

    row: Int
    """(k,). Points that are doubtful."""
    height_m: Float
    """(k,), m. Above the terrain."""
    test: Float
    """(k,). In standard deviations."""
    limit: float


def off_terrain(xyz_m: Float, sigma_m: Float, rays: Int, flying_height_m: float, downwards: float = 1.0) -> OffTerrain:
    """Find points that lie off the terrain around them.

    Parameters
    ----------
    xyz_m : (n, 3) float64, m
        NaN not known.
    sigma_m : (n,) float64, m
        Of the heights; NaN not known.
    rays : (n,) int
        Of each point.
    flying_height_m : float, m
    downwards : float
        Of the images, in the median: cosine between their axes and the nadir. Who looks along the ground sees walls.
    """
    from scipy.spatial import cKDTree

    ground = np.flatnonzero(finite_rows(xyz_m) & (rays >= 2))
    firm, weak = ground[rays[ground] > 2], ground[rays[ground] == 2]
    if len(firm) < FEWEST or downwards < LEAST_DOWNWARDS:
        return OffTerrain(np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0), np.inf)
    tree = cKDTree(xyz_m[ground, :2])
    tested = np.concatenate([firm[:: max(1, len(firm) // MOST)], weak])
    distances_m, near = tree.query(xyz_m[tested, :2], k=NEIGHBOURS + 1)
    height_above_m, q, roughness = _above(xyz_m, tested, ground[near[:, 1:]])
    is_firm = rays[tested] > 2
    spacing_m = np.maximum(np.median(distances_m[:, 1:], axis=1), 1e-9)
    spread = np.maximum(1.0, (spacing_m / np.median(spacing_m[is_firm])) ** 2)
    rough = 1.4826 * float(np.median((np.abs(height_above_m) / np.sqrt(1 + q))[is_firm]))
    s2 = (np.maximum(roughness, rough) * spread) ** 2 * (1 + q) + np.nan_to_num(sigma_m[tested]) ** 2
    test = np.where((s2 > 0) & (q <= SURROUNDED), np.abs(height_above_m) / np.sqrt(np.where(s2 > 0, s2, 1.0)), 0.0)
    limit = limit_of_tests(len(tested), ALARM)
    far = is_firm & (test > limit) & (np.abs(height_above_m) > FAR_FROM_TERRAIN * abs(flying_height_m))
    limit = max(limit, LONGER_EDGE * float(test[is_firm & ~far].max(initial=0.0)))
    heights_m = xyz_m[tested, 2]
    lowest, highest = heights_m[is_firm & ~far].min(), heights_m[is_firm & ~far].max()
    beyond_m = heights_m - np.clip(heights_m, lowest, highest)
    of_own = np.abs(beyond_m) / np.maximum(np.nan_to_num(sigma_m[tested]), 1e-9)
    least_m = BEYOND_TERRAIN * abs(flying_height_m) if highest - lowest <= abs(flying_height_m) else np.inf
    outside = ~is_firm & (q > SURROUNDED) & (np.abs(beyond_m) > least_m) & (of_own > limit)
    doubtful = far | outside | (~is_firm & (test > limit))
    height_above_m, test = np.where(outside, beyond_m, height_above_m), np.where(outside, of_own, test)
    return OffTerrain(tested[doubtful], height_above_m[doubtful], test[doubtful], limit)


def _above(xyz_m: Float, points: Int, near: Int) -> tuple[Float, Float, Float]:
    """Heights above the planes of the neighbours, cofactors of the planes there, roughness of the neighbours, (n,)."""
    d = xyz_m[near] - xyz_m[points][:, None]
    scale = np.maximum(np.abs(d[:, :, :2]).max(axis=(1, 2)), 1e-9)
    A = np.concatenate([np.ones((*near.shape, 1)), d[:, :, :2] / scale[:, None, None]], axis=2)
    z, weight = d[:, :, 2], np.ones(near.shape)
    least = 1e-6 * scale[:, None]
    ridge = 1e-6 * np.eye(3)  # neighbours on a line carry a plane through it
    for _ in range(ITERATIONS):
        N = np.einsum("nki,nk,nkj->nij", A, weight, A)
        N += ridge * np.einsum("nii->n", N)[:, None, None]
        plane = np.linalg.solve(N, np.einsum("nki,nk,nk->ni", A, weight, z)[:, :, None])[:, :, 0]
        r = z - np.einsum("nki,ni->nk", A, plane)
        weight = 1.0 / np.maximum(np.abs(r), least + 0.1 * np.median(np.abs(r), axis=1, keepdims=True))
    G = np.einsum("nki,nkj->nij", A, A)
    G += ridge * np.einsum("nii->n", G)[:, None, None]
    return -plane[:, 0], np.linalg.inv(G)[:, 0, 0], 1.4826 * np.median(np.abs(r), axis=1)
