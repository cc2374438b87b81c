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
from aatri.geometry.similarity import IDENTITY, Similarity, compose, robust_closed_form

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


@dataclass(frozen=True)
class _Body:
    """Points of a component, ascending: sums over its strips of coordinates and variances, and how many they are."""

    point: Int
    xyz: Float
    variance: Float
    count: Float


def grow_components(points: StripPoints, n_strips: int) -> tuple[Int, list[Similarity], dict[tuple[int, int], Tie]]:
    """Join components pair by pair, the best tied first; returns label, pose of every strip and the ties left over."""
    member = np.arange(n_strips)
    pose = [IDENTITY] * n_strips
    bodies = {k: _body(points, k) for k in range(n_strips)}
    ties = {(a, b): _tie(bodies[a], bodies[b]) for a, b in _neighbours(points, n_strips)}
    while True:
        good = [(tie.sigma_rad, pair) for pair, tie in ties.items() if tie.sigma_rad <= WEAKEST_RAD]
        if not good:
            return member, pose, ties
        _, (a, b) = min(good)
        joined = ties[a, b].similarity
        for k in np.flatnonzero(member == b):
            pose[k] = compose(joined, pose[k])
        member = np.where(member == b, a, member)
        bodies[a] = _merged(bodies[a], bodies.pop(b), joined)
        ties = {pair: tie for pair, tie in ties.items() if a not in pair and b not in pair}
        held = np.zeros(int(points.point.max()) + 1, dtype=bool)
        held[bodies[a].point] = True
        for label in np.unique(member[points.strip[held[points.point]]]).tolist():
            if label != a:
                pair = (min(a, label), max(a, label))
                ties[pair] = _tie(bodies[pair[0]], bodies[pair[1]])


def _neighbours(points: StripPoints, n_strips: int) -> list[tuple[int, int]]:
    """Pairs of strips with common points, in order."""
    key = np.unique(points.point.astype(np.int64) * n_strips + points.strip)
    point, strip = np.divmod(key, n_strips)
    pairs = [np.zeros(0, dtype=np.int64)]
    for step in range(1, int(np.bincount(point).max(initial=0))):
        same = point[:-step] == point[step:]
        pairs.append(np.unique(strip[:-step][same] * n_strips + strip[step:][same]))
    return [(k // n_strips, k % n_strips) for k in np.unique(np.concatenate(pairs)).tolist()]


def _body(points: StripPoints, strip: int) -> _Body:
    rows = np.flatnonzero(points.strip == strip)
    variance = np.einsum("nii->n", points.covariance[rows]) / 3
    return _summed(points.point[rows], points.xyz[rows], variance, np.ones(len(rows)))


def _merged(first: _Body, second: _Body, similarity: Similarity) -> _Body:
    """One body of two, the second moved."""
    moved = second.count[:, None] * similarity.translation + similarity.scale * second.xyz @ similarity.rotation.T
    return _summed(
        np.concatenate([first.point, second.point]),
        np.concatenate([first.xyz, moved]),
        np.concatenate([first.variance, similarity.scale**2 * second.variance]),
        np.concatenate([first.count, second.count]),
    )


def _summed(point: Int, xyz: Float, variance: Float, count: Float) -> _Body:
    distinct, of = np.unique(point, return_inverse=True)
    n = len(distinct)
    columns = [*xyz.T, variance, count]
    sums: Float = np.stack([np.bincount(of, c, n).astype(np.float64) for c in columns], axis=1)
    return _Body(distinct, sums[:, :3], sums[:, 3], sums[:, 4])


def _tie(a: _Body, b: _Body) -> Tie:
    """The similarity from component b to component a, and how well it is determined."""
    _, first, second = np.intersect1d(a.point, b.point, assume_unique=True, return_indices=True)
    X, variance_a = a.xyz[first] / a.count[first, None], a.variance[first] / a.count[first] ** 2
    x, variance_b = b.xyz[second] / b.count[second, None], b.variance[second] / b.count[second] ** 2
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
