"""Free components: strips, each in a frame of its own, joined to each other by common points.

1. Components grow from single strips: of all pairs of components the best tied pair is joined first, by the similarity
   of their common points with the least sum of distances (geometry.similarity). How well a pair is tied is the standard
   deviation of its weakest rotation, about the line along which the common points lie:

       sigma_rotation = sigma_point / sqrt(sum of squared distances from that line).

   Above `WEAKEST_RAD` the points count as collinear and the pair is not joined; so it is with fewer than 3 points.
2. All strips of a component are then adjusted together as similarities of seven unknowns each, the common points
   eliminated (orientation.tied_strips), one strip held; wrong ties are found by data snooping.

The frame and unit of a component are those of the strip with most points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from aatri.geometry.similarity import (
    IDENTITY,
    Similarity,
    compose,
    inverse,
    jacobian,
    robust_closed_form,
    transform,
    transform_covariance,
    updated,
)
from aatri.orientation.tie_elimination import Linearised, observations_of
from aatri.orientation.tied_strips import Problem, TiedResult, adjust_tied

Float = npt.NDArray[np.float64]
Int = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]

WEAKEST_RAD = 0.05
"""A tie whose weakest rotation is known worse than this joins nothing."""

TIE_LIMIT = 6.0
"""Test statistic of a wrong tie. Strips are deformed smoothly, so that good ties reach larger values than noise."""


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
class Component:
    """Strips joined to one free body.

    Attributes
    ----------
    strips : (k,) int
        Numbers of the strips, ascending.
    component_from_strip : tuple of Similarity
        For each of them.
    rows : (m,) int
        Rows of its points in the StripPoints.
    point : (p,) int
        Numbers of its points, ascending.
    xyz : (p, 3) float64, unit of the component
    covariance : (p, 3, 3) float64, unit of the component squared
    tied : TiedResult or None
        The adjustment; None for a single strip. Its observations are the rows.
    """

    strips: Int
    component_from_strip: tuple[Similarity, ...]
    rows: Int
    point: Int
    xyz: Float
    covariance: Float
    tied: TiedResult[list[Similarity]] | None


@dataclass(frozen=True)
class FreeBlock:
    """Free components, and why they were not joined further.

    Attributes
    ----------
    components : tuple of Component
        Largest first (number of points, then first strip).
    active : (n,) bool
        Rows of the StripPoints not rejected.
    unjoined : tuple of str
        For each pair of components with few or bad ties: what is missing.
    """

    components: tuple[Component, ...]
    active: Bool
    unjoined: tuple[str, ...]


@dataclass(frozen=True)
class _Tie:
    similarity: Similarity
    sigma_rad: float
    common: int


def join_strips(
    points: StripPoints, names: Sequence[str], *, active: Bool | None = None, limit: float = TIE_LIMIT
) -> FreeBlock:
    """Join strips by common points to free components.

    Parameters
    ----------
    points : StripPoints
    names : (n_strips,) sequence of str
        Names of the strips, for messages.
    active : (n,) bool, optional
        Rows to begin with; the others are tested for re-admission.
    limit : float
        Test statistic of a wrong tie.
    """
    use = np.ones(len(points.strip), dtype=bool) if active is None else active.copy()
    member, pose, weak = _grow(points.take(use), len(names))
    components = []
    for label in np.unique(member):
        strips = np.flatnonzero(member == label)
        component = _adjusted(points, strips, [pose[k] for k in strips], use, limit, names)
        components.append(component)
        if component.tied is not None:
            use[component.rows] = component.tied.active
    components.sort(key=lambda c: (-len(c.point), int(c.strips[0])))
    return FreeBlock(tuple(components), use, _reasons(components, weak, member, names))


def _grow(points: StripPoints, n_strips: int) -> tuple[Int, list[Similarity], dict[tuple[int, int], _Tie]]:
    """Join components pair by pair, the best tied first; returns label, pose of every strip and the ties left over."""
    member = np.arange(n_strips)
    pose = [IDENTITY] * n_strips
    ties: dict[tuple[int, int], _Tie] = {}
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
        for pair in _neighbours(points, member):
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


def _tie(points: StripPoints, member: Int, pose: list[Similarity], a: int, b: int) -> _Tie:
    """The similarity from component b to component a, and how well it is determined."""
    sides = [_mean_points(points, np.flatnonzero(member == label), pose) for label in (a, b)]
    _, first, second = np.intersect1d(sides[0][0], sides[1][0], return_indices=True)
    X, variance_a = sides[0][1][first], sides[0][2][first]
    x, variance_b = sides[1][1][second], sides[1][2][second]
    if len(X) < 3:
        return _Tie(IDENTITY, np.inf, len(X))
    similarity, distance = robust_closed_form(x, X)
    noise = np.sqrt(np.median(variance_a + similarity.scale**2 * variance_b))
    sigma = max(float(noise), float(np.median(distance)) / 1.5 if len(X) > 3 else 0.0)
    fitting = distance <= 10 * max(sigma, float(np.median(distance)))
    spread = np.linalg.svd(X[fitting] - X[fitting].mean(0), compute_uv=False)
    across = float(np.hypot(*spread[1:3]))
    determined = fitting.sum() >= 3 and across > 1e-9 * spread[0]
    return _Tie(similarity, sigma / across if determined else np.inf, len(X))


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


def _adjusted(
    points: StripPoints, strips: Int, pose: list[Similarity], use: Bool, limit: float, names: Sequence[str]
) -> Component:
    rows = np.flatnonzero(np.isin(points.strip, strips))
    mine = points.take(rows)
    number, point = np.unique(mine.point, return_inverse=True)
    if len(strips) == 1:
        # An identity pose, so that the component is the strip itself.
        order = np.argsort(point)
        return Component(strips, (IDENTITY,), rows, number, mine.xyz[order], mine.covariance[order], None)
    local = np.searchsorted(strips, mine.strip)
    held = int(np.argmax(np.bincount(local, minlength=len(strips))))
    to_held = inverse(pose[held])
    centre = np.stack([mine.xyz[local == k].mean(0) for k in range(len(strips))])
    start = [compose(compose(to_held, p), Similarity(c, 1.0, np.eye(3))) for p, c in zip(pose, centre)]
    reduced = mine.xyz - centre[local]

    def linearise(state: list[Similarity]) -> Linearised:
        xyz, J, C = np.empty_like(reduced), np.zeros((len(reduced), 3, 7)), np.empty_like(mine.covariance)
        for k, similarity in enumerate(state):
            of = local == k
            xyz[of] = transform(similarity, reduced[of])
            J[of] = jacobian(similarity, reduced[of])
            C[of] = transform_covariance(similarity, mine.covariance[of])
        return Linearised(xyz, J, C)

    def update(state: list[Similarity], dx: Float) -> list[Similarity]:
        moving = [k for k in range(len(state)) if k != held]
        steps = dict(zip(moving, dx.reshape(-1, 7)))
        return [updated(s, steps[k]) if k in steps else s for k, s in enumerate(state)]

    what = f"joining strips {', '.join(str(names[k]) for k in strips)}"
    problem = Problem(observations_of(local, point, len(number), held=held), linearise, update, what)
    tied = adjust_tied(problem, start, limit=limit, active=use[rows])
    component_from_strip = [compose(s, Similarity(-c, 1.0, np.eye(3))) for s, c in zip(tied.state, centre)]
    solved = np.isfinite(tied.point_m).all(1)
    return Component(strips, tuple(component_from_strip), rows, number[solved], tied.point_m[solved],
                     tied.point_covariance_m2[solved], tied)  # fmt: skip


def _reasons(
    components: list[Component], weak: dict[tuple[int, int], _Tie], member: Int, names: Sequence[str]
) -> tuple[str, ...]:
    components = sorted(components, key=lambda c: int(c.strips[0]))
    label = [int(member[c.strips[0]]) for c in components]
    texts = []
    for i, first in enumerate(components):
        for j, second in enumerate(components[i + 1 :], i + 1):
            tie = weak.get((min(label[i], label[j]), max(label[i], label[j])))
            between = f"{strip_names(first, names)} and {strip_names(second, names)}"
            if tie is None:
                texts.append(f"{between} have no common point")
            elif tie.common < 3:
                texts.append(f"{between} have {tie.common} common point{'s' * (tie.common > 1)}, 3 are needed")
            else:
                texts.append(f"{between} have {tie.common} common points that lie on a line")
    return tuple(texts)


def strip_names(component: Component, names: Sequence[str]) -> str:
    """`strip 1` or `strips 1, 2`."""
    plural = "strips" if len(component.strips) > 1 else "strip"
    return f"{plural} {', '.join(str(names[k]) for k in component.strips)}"
