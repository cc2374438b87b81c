"""Components of strips grow pair by pair, the best tied pair first.

How well a pair of components is tied is the standard deviation of its weakest rotation, about the line along which the
common points lie:

    sigma_rotation = sigma_point / sqrt(sum of squared distances from that line),

sigma_point from the covariances of the points or from their discrepancies, whichever is larger. Above `WEAKEST_RAD` the
points count as collinear and the pair is not joined; so it is with fewer than 3 points. The similarity of a pair is
that with the least sum of distances (geometry.similarity), which wrong points hardly disturb.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.geometry.similarity import IDENTITY, Similarity, compose, robust_closed_form, transform

WEAKEST_RAD = 0.05
"""A tie whose weakest rotation is known worse than this joins nothing."""


@dataclass(frozen=True)
class StripPoints:
    """Points of all strips, in the strips' own frames.

    Attributes
    ----------
    strip : (n,) int
    point : (n,) int
    xyz : (n, 3) float64, unit of the strip
    covariance : (n, 3, 3) float64, unit of the strip squared
    """

    strip: Int
    point: Int
    xyz: Float
    covariance: Float

    def take(self, rows: Bool | Int) -> StripPoints:
        """The chosen rows."""
        return StripPoints(self.strip[rows], self.point[rows], self.xyz[rows], self.covariance[rows])


@dataclass(frozen=True)
class Tie:
    """Similarity from one component to another, how well it is determined, and the number of common points."""

    similarity: Similarity
    sigma_rad: float
    common: int


def grow_components(points: StripPoints, n_strips: int) -> tuple[Int, list[Similarity], dict[tuple[int, int], Tie]]:
    """Join components pair by pair, the best tied first; returns label, pose of every strip and the ties left over."""
    member = np.arange(n_strips)
    pose = [IDENTITY] * n_strips
    ties: dict[tuple[int, int], Tie] = {}
    for a, b in _neighbours(points, member):
        ties[a, b] = _tie(points, member, pose, a, b)
    while True:
        good = [(tie.sigma_rad, pair) for pair, tie in ties.items() if tie.sigma_rad <= WEAKEST_RAD]
        if not good:
            return member, pose, ties
        _, (a, b) = min(good)
        joined = ties[a, b].similarity
        for k in np.flatnonzero(member == b):
            pose[k] = compose(joined, pose[k])
        member = np.where(member == b, a, member)
        ties = {pair: tie for pair, tie in ties.items() if a not in pair and b not in pair}
        touching = np.isin(points.point, points.point[member[points.strip] == a])
        for pair in _neighbours(points.take(touching), member):
            if a in pair:
                ties[pair] = _tie(points, member, pose, *pair)


def _neighbours(points: StripPoints, member: Int) -> list[tuple[int, int]]:
    """Pairs of components with common points, in order."""
    label = member[points.strip]
    key = np.unique(np.stack([points.point, label], 1), axis=0)
    pairs: set[tuple[int, int]] = set()
    for step in range(1, int(np.bincount(key[:, 0]).max(initial=0))):
        same = key[:-step, 0] == key[step:, 0]
        found = np.unique(np.stack([key[:-step][same, 1], key[step:][same, 1]], 1), axis=0)
        pairs.update((int(a), int(b)) for a, b in found)
    return sorted(pairs)


def _tie(points: StripPoints, member: Int, pose: list[Similarity], a: int, b: int) -> Tie:
    """The similarity from component b to component a, and how well it is determined."""
    sides = [_mean_points(points, np.flatnonzero(member == label), pose) for label in (a, b)]
    _, first, second = np.intersect1d(sides[0][0], sides[1][0], return_indices=True)
    X, variance_a = sides[0][1][first], sides[0][2][first]
    x, variance_b = sides[1][1][second], sides[1][2][second]
    if len(X) < 3:
        return Tie(IDENTITY, np.inf, len(X))
    similarity, distance = robust_closed_form(x, X)
    noise = np.sqrt(np.median(variance_a + similarity.scale**2 * variance_b))
    # Three points are fitted by seven parameters: two of nine coordinates are left over.
    sigma = max(float(noise), float(np.median(distance)) / 1.5 if len(X) > 3 else float(np.linalg.norm(distance)) / 1.5)
    fitting = distance <= 10 * max(sigma, float(np.median(distance)))
    if np.count_nonzero(fitting) < 3:  # most common points are wrong ones
        return Tie(similarity, np.inf, len(X))
    spread = np.linalg.svd(X[fitting] - X[fitting].mean(0), compute_uv=False)
    across = float(np.hypot(*spread[1:3]))
    return Tie(similarity, sigma / across if across > 1e-9 * spread[0] else np.inf, len(X))


def _mean_points(points: StripPoints, strips: Int, pose: list[Similarity]) -> tuple[Int, Float, Float]:
    """Points of a component, coordinates as plain means over its strips, and their mean variances."""
    number, xyz, variance = [], [], []
    for k in strips:
        rows = points.strip == k
        number.append(points.point[rows])
        xyz.append(transform(pose[k], points.xyz[rows]))
        variance.append(pose[k].scale ** 2 * np.einsum("nii->n", points.covariance[rows]) / 3)
    distinct, of = np.unique(np.concatenate(number), return_inverse=True)
    count = np.bincount(of)
    mean = np.stack([np.bincount(of, column) for column in np.concatenate(xyz).T], 1) / count[:, None]
    return distinct, mean, np.bincount(of, np.concatenate(variance)) / count**2
