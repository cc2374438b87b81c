"""Components of strips grow pair by pair, the best tied pair first.

How well a pair of components is tied is the standard deviation of its weakest rotation, about the line along which the
common points lie:

    sigma_rotation = sigma_point / sqrt(sum of squared distances from that line),

sigma_point from the covariances of the points or from their discrepancies, whichever is larger. Above `WEAKEST_TIE_RAD`
the points count as collinear and the pair is not joined; so it is with fewer than 3 points. Where the smaller component
reaches farther from that line than `LONGEST_LEVER` times the denominator, errors of the points grow as many times at
its edge: such a pair is joined only if asked for (`weakly`). The similarity of a pair is that with the least sum of
distances (geometry.similarity), which wrong points hardly disturb, but one that lies far out along the line of the
others: a number given to two places. Where common points do not fit each other the tie is tried without each of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, replace

import numpy as np

from aatri.adjustment.threads import WORTH_A_THREAD, in_threads
from aatri.arrays import Bool, Float, Int, sums_of
from aatri.geometry.similarity import IDENTITY, ITERATIONS, Similarity, compose
from aatri.orientation.bodies.kernels.robust_similarity import robust_similarities
from aatri.orientation.bodies.limits import FEWEST_MIRRORED, LONGEST_LEVER, MIRRORED_CLEARLY, WEAKEST_TIE_RAD

MIRRORED = "fit only mirrored: an axis of one has the wrong sign"

MISFIT = "do not fit each other"

FEW = 1_000
"""Points of a large body that mostly show that it reaches farther than another."""


@dataclass(frozen=True)
class BodyPoints:
    """Points of all strips, in the strips' own frames."""

    strip: Int
    """(n,)."""
    point: Int
    """(n,)."""
    xyz: Float
    """(n, 3), unit of the strip."""
    covariance: Float
    """(n, 3, 3), unit of the strip squared."""

    def take(self, rows: Bool | Int) -> BodyPoints:
        """The chosen rows."""
        return BodyPoints(self.strip[rows], self.point[rows], self.xyz[rows], self.covariance[rows])


@dataclass(frozen=True)
class Tie:
    """Similarity from one component to another, how well it is determined, and the number of common points.

    `lever` is how many times errors of these grow at the edge of the smaller component; `misfit` says what speaks
    against points that would tie well if they agreed.
    """

    similarity: Similarity
    sigma_rad: float
    common: int
    lever: float
    misfit: str = ""

    def joins(self, *, weakly: bool) -> bool:
        """Whether it is good enough."""
        return not self.misfit and self.sigma_rad <= WEAKEST_TIE_RAD and (weakly or self.lever <= LONGEST_LEVER)


@dataclass(frozen=True)
class _Body:
    """Points of a component, and sums over its strips."""

    point: Int
    """(n,), ascending."""
    sums: Float
    """(n, 5). Of coordinates and variances, and how many they are."""

    def mean(self, rows: Int | slice) -> tuple[Float, Float]:
        """Mean coordinates of some points and their variances, (n, 3), (n,)."""
        sums = self.sums[rows]
        return sums[:, :3] / sums[:, 4:], sums[:, 3] / sums[:, 4] ** 2


@dataclass(frozen=True)
class _Common:
    """Common points of two components, in the frame of the second and of the first, and their variances."""

    source: Float
    target: Float
    source_variance: Float
    target_variance: Float

    def without(self, k: int) -> _Common:
        """All but one."""
        return _Common(*(np.delete(values, k, axis=0) for values in astuple(self)))


def grow_components(
    points: BodyPoints, n_strips: int, *, weakly: bool = True
) -> tuple[Int, list[Similarity], dict[tuple[int, int], Tie]]:
    """Join components pair by pair, the best tied first; returns label, pose of every strip and the ties left over."""
    member = np.arange(n_strips)
    pose = [IDENTITY] * n_strips
    bodies = {k: _body(points, k) for k in range(n_strips)}
    neighbours = _neighbours(points, n_strips)
    beside: list[set[int]] = [set() for _ in range(n_strips)]
    for a, b in neighbours:
        beside[a].add(b)
        beside[b].add(a)
    ties = _ties(bodies, neighbours)
    while True:
        good = [(tie.sigma_rad, pair) for pair, tie in ties.items() if tie.joins(weakly=weakly)]
        if not good:
            return member, pose, ties
        _, (a, b) = min(good)
        joined = ties[a, b].similarity
        for k in np.flatnonzero(member == b):
            pose[k] = compose(joined, pose[k])
        member = np.where(member == b, a, member)
        bodies[a] = _merged(bodies[a], bodies.pop(b), joined)
        ties = {pair: tie for pair, tie in ties.items() if a not in pair and b not in pair}
        beside[a] |= beside[b]
        near = sorted({int(member[strip]) for strip in beside[a]} - {a})
        ties |= _ties(bodies, [(min(a, label), max(a, label)) for label in near])


def _neighbours(points: BodyPoints, n_strips: int) -> list[tuple[int, int]]:
    """Pairs of strips with common points, in order."""
    key = np.unique(points.point.astype(np.int64) * n_strips + points.strip)
    point, strip = np.divmod(key, n_strips)
    pairs = [np.zeros(0, dtype=np.int64)]
    for step in range(1, int(np.bincount(point).max(initial=0))):
        same = point[:-step] == point[step:]
        pairs.append(np.unique(strip[:-step][same] * n_strips + strip[step:][same]))
    return [(k // n_strips, k % n_strips) for k in np.unique(np.concatenate(pairs)).tolist()]


def _body(points: BodyPoints, strip: int) -> _Body:
    rows = np.flatnonzero(points.strip == strip)
    variance = np.einsum("nii->n", points.covariance[rows]) / 3
    point, place = np.unique(points.point[rows], return_inverse=True)
    values = np.column_stack([points.xyz[rows], variance, np.ones(len(rows))])
    return _Body(point, sums_of(values, place, len(point)))


def _merged(first: _Body, second: _Body, similarity: Similarity) -> _Body:
    """One body of two, the second moved."""
    count, scale = second.sums[:, 4:], similarity.scale
    moved = count * similarity.translation + scale * second.sums[:, :3] @ similarity.rotation.T
    second = _Body(second.point, np.column_stack([moved, scale**2 * second.sums[:, 3], count]))
    small, large = sorted((first, second), key=lambda body: len(body.point))
    place = np.searchsorted(large.point, small.point)
    there = large.point[np.minimum(place, len(large.point) - 1)] == small.point
    sums = large.sums.copy()
    sums[place[there]] += small.sums[there]
    new = place[~there]
    return _Body(np.insert(large.point, new, small.point[~there]), np.insert(sums, new, small.sums[~there], axis=0))


def _ties(bodies: Mapping[int, _Body], pairs: Sequence[tuple[int, int]]) -> dict[tuple[int, int], Tie]:
    """For each pair of components the similarity from the second to the first, and how well it is determined."""
    common = [_common(bodies[a], bodies[b]) for a, b in pairs]
    enough = [k for k, c in enumerate(common) if len(c.target) >= 3]
    ties = {pair: Tie(IDENTITY, np.inf, len(c.target), np.inf) for pair, c in zip(pairs, common)}
    for k, tie in zip(enough, _fitted([common[k] for k in enough], [_of_pair(bodies, pairs[k]) for k in enough])):
        ties[pairs[k]] = _without_one(common[k], _of_pair(bodies, pairs[k])) or tie if tie.misfit == MISFIT else tie
    return ties


def _of_pair(bodies: Mapping[int, _Body], pair: tuple[int, int]) -> tuple[_Body, _Body]:
    return bodies[pair[0]], bodies[pair[1]]


def _fitted(common: Sequence[_Common], bodies: Sequence[tuple[_Body, _Body]]) -> list[Tie]:
    """Ties of pairs of bodies by common points, three or more of each."""
    similarities, distances = _robust(common)
    weakest = [_weakest_rotation(*one) for one in zip(common, similarities, distances, bodies)]
    far = [
        k
        for k, (sigma, n, _, by_noise) in enumerate(weakest)
        if n >= FEWEST_MIRRORED and by_noise < MIRRORED_CLEARLY * sigma
    ]
    _, if_mirrored = _robust([replace(common[k], source=common[k].source * [1.0, 1.0, -1.0]) for k in far])
    mirrored = {k for k, by in zip(far, if_mirrored) if np.median(by) < MIRRORED_CLEARLY * np.median(distances[k])}
    ties = []
    for k, (sigma, n, lever, by_noise) in enumerate(weakest):
        misfit = MISFIT if by_noise <= WEAKEST_TIE_RAD < sigma else ""
        ties.append(Tie(similarities[k], sigma, n, lever, MIRRORED if k in mirrored else misfit))
    return ties


def _without_one(common: _Common, bodies: tuple[_Body, _Body]) -> Tie | None:
    """The best tie without one of the common points, where four or more are left and fit each other."""
    n = len(common.target)
    if n <= 4:
        return None
    ties = _fitted([common.without(k) for k in range(n)], [bodies] * n)
    return min((tie for tie in ties if tie.joins(weakly=True)), key=lambda tie: tie.sigma_rad, default=None)


def _common(a: _Body, b: _Body) -> _Common:
    """Common points of two components."""
    small, large = sorted((a, b), key=lambda body: len(body.point))
    place = np.minimum(np.searchsorted(large.point, small.point), len(large.point) - 1)
    of_small = np.flatnonzero(large.point[place] == small.point)
    means = {id(small): small.mean(of_small), id(large): large.mean(place[of_small])}
    (source, source_variance), (target, target_variance) = means[id(b)], means[id(a)]
    return _Common(source, target, source_variance, target_variance)


def _robust(pairs: Sequence[_Common]) -> tuple[list[Similarity], list[Float]]:
    """The similarities with the least sums of distances, and these; see geometry.similarity.robust_closed_form."""
    if not pairs:
        return [], []
    start = np.concatenate([[0], np.cumsum([len(c.source) for c in pairs])]).astype(np.int64)
    n, distance = len(pairs), np.empty(start[-1])
    shift, scale, rotation = np.empty((n, 3)), np.empty(n), np.empty((n, 3, 3))
    source, target = np.concatenate([c.source for c in pairs]), np.concatenate([c.target for c in pairs])

    def of(a: int, b: int) -> None:
        own = shift[a:b], scale[a:b], rotation[a:b]
        robust_similarities(start[a : b + 1], source, target, ITERATIONS, *own, distance)

    in_threads(n, of, worth=max(1, n * WORTH_A_THREAD // (ITERATIONS * int(start[-1]))))
    similarities = [Similarity(shift[k], float(scale[k]), rotation[k]) for k in range(n)]
    return similarities, np.split(distance, start[1:-1])


def _weakest_rotation(
    common: _Common, similarity: Similarity, distance: Float, bodies: tuple[_Body, _Body]
) -> tuple[float, int, float, float]:
    """Standard deviation of the rotation about the line along which the common points lie, rad; their number; lever.

    Last the standard deviation that it would have by those of the points alone.
    """
    X, n = common.target, len(distance)
    noise = float(np.sqrt(np.median(common.target_variance + similarity.scale**2 * common.source_variance)))
    middle = float(np.median(distance))
    # Three points are fitted by seven parameters: two of nine coordinates are left over.
    sigma = max(noise, middle / 1.5 if n > 3 else float(np.linalg.norm(distance)) / 1.5)
    fitting = distance <= 10 * max(sigma, middle)
    if np.count_nonzero(fitting) < 3:  # most common points are wrong ones
        return np.inf, n, np.inf, 0.0
    centre = X[fitting].mean(0)
    _, spread, directions = np.linalg.svd(np.linalg.qr(X[fitting] - centre, mode="r"))
    across = float(np.hypot(*spread[1:3]))
    if across <= 1e-9 * spread[0]:
        return np.inf, n, np.inf, np.inf
    reach = _shorter_reach(bodies, similarity, centre, directions[0])
    return sigma / across, n, reach / across, noise / across


def _shorter_reach(bodies: tuple[_Body, _Body], similarity: Similarity, centre: Float, direction: Float) -> float:
    """Largest distance of a body's points from a line, of the body where it is less; the second is moved."""

    def reach(body: _Body, rows: slice) -> float:
        xyz = body.mean(rows)[0]
        if body is bodies[1]:
            xyz = similarity.translation + similarity.scale * xyz @ similarity.rotation.T
        away = xyz - centre
        away -= np.outer(away @ direction, direction)
        return float(np.sqrt(np.einsum("ni,ni->n", away, away).max()))

    small, large = sorted(bodies, key=lambda body: len(body.point))
    shorter = reach(small, slice(None))
    if reach(large, slice(None, None, 1 + len(large.point) // FEW)) >= shorter:  # by some of its points already
        return shorter
    return min(shorter, reach(large, slice(None)))
