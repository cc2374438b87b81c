"""Bodies that only together are determined: by what is observed of each, and by the points that they share.

    X_k(p) - X_l(p) = 0,    X_k = T_k + s_k R_k x_k,    weighed by the variances of p in both bodies

beside the observations of each body, whose own unknowns are eliminated body by body. All similarities are adjusted at
once (Levenberg-Marquardt). One body after the other joins those that have begun, levelled and turned through all
headings, if it fits these; of all headings of the first the end of most bodies and least cost counts. With N = J'J of
the whitened derivatives and M_k the mean of G'G over the places of body k, whose motions are dX = G z_k, the solutions
of

    N z = lambda M z

move the bodies by 1 (RMS) with a standard deviation of 1 / sqrt(lambda): bodies that move by what is known worse than
to `UNKNOWN_MOTION` of their extent are not determined.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag, eigh

from aatri.adjusting.added_variance import observed_components
from aatri.adjustment.records import whitened
from aatri.arrays import Float, Int
from aatri.geometry.similarity import IDENTITY, UNKNOWNS, Similarity, motions, transform
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT
from aatri.observations.ties import BODY
from aatri.orientation.bodies.common_datum import RIDGE
from aatri.orientation.bodies.datum_analysis import given_places
from aatri.orientation.bodies.datum_start import (
    ITERATIONS,
    SAME_ENDS,
    TOLERANCE,
    Observe,
    all_headings,
    of_body,
    retracted,
    scaled,
    typical_distance,
    weighed,
)
from aatri.orientation.bodies.free_body import FreeBody, state_of
from aatri.orientation.bodies.limits import FARTHEST_START, MOVED_SHARE, UNKNOWN_MOTION

DAMPING, SMALLEST_DAMPING, LARGEST = 1e-3, 1e-9, 1e8
"""Of the first step, as a share of the diagonal; below which rounding would decide, and beyond which no step reduces
the cost."""

EXACT = 1e-6
"""Least standard deviation of points that are shared, as a share of their distance: exact ones are weighed so."""

MOST = 8
"""Bodies that are tried together, as the time grows with the third power of their number: 8 take 4 s, 16 took 20."""

Placed = Mapping[int, Similarity]
End = tuple[float, Placed]
"""Half the sum of squares, and where it is reached."""


def joint_start(bodies: Sequence[FreeBody], observes: Sequence[Observe]) -> tuple[list[int], Placed]:
    """Numbers of bodies that were tried together, and ground from body of those of them that are determined.

    Parameters
    ----------
    observes : sequence of callable
        Of each body, where it lies -> the observations that concern it.
    """
    conditions = [_conditions(observe(IDENTITY)) for observe in observes]
    if not (enough := _with_enough(bodies, conditions)):
        return [*range(len(bodies))], {}
    order, bodies = _order(bodies, conditions, enough), [_inexact(body) for body in bodies]
    try:
        to = _least_end(bodies, observes, order)[1]
        return (order, _determined(bodies, observes, to)) if to else (order[:1], {})
    except np.linalg.LinAlgError:  # rounding decides
        return order, {}


def _inexact(body: FreeBody) -> FreeBody:
    """A body whose points have a variance."""
    least = EXACT * typical_distance(body, IDENTITY)
    return replace(body, covariance=body.covariance + least**2 * np.eye(3))


def _conditions(observed: Sequence[Observed]) -> int:
    """How many observations are left for the similarity of a body, if all are independent."""
    own = {u.name: int(u.free.sum()) for o in observed for u in o.unknowns}
    return max(0, sum(int(observed_components(o).sum()) for o in observed) - sum(own.values()))


def _with_enough(bodies: Sequence[FreeBody], conditions: Sequence[int]) -> list[int]:
    """Bodies with as many observations and coordinates of points in common with others of them as they have unknowns.

    One with fewer is open, and tells the others nothing of each other: it takes up all that it shares with them.
    """
    has_point = np.array([body.has[POINT] for body in bodies])
    left = np.arange(len(bodies))
    while len(left):
        shared = (has_point[left] & (has_point[left].sum(axis=0) > 1)).sum(axis=1)
        enough = np.array(conditions)[left] + 3 * shared >= UNKNOWNS
        if enough.all():
            break
        left = left[enough]
    return left.tolist()


def _order(bodies: Sequence[FreeBody], conditions: Sequence[int], left: list[int]) -> list[int]:
    """Bodies that hang together by points: that of most observations, then the one that shares most with these."""
    has_point = [body.has[POINT] for body in bodies]
    order = [max(left, key=lambda k: conditions[k])]
    while (left := [k for k in left if k not in order]) and len(order) < MOST:
        shared = [sum(int((has_point[k] & has_point[other]).sum()) for other in order) for k in left]
        if not max(shared):
            break
        order.append(left[int(np.argmax(shared))])
    return order


def _least_end(bodies: Sequence[FreeBody], observes: Sequence[Observe], order: Sequence[int]) -> End:
    """The end of most bodies and least cost; a body that contradicts those before it has no part, nor has the first."""
    first, *others = order
    ends = list[End]()
    for start in all_headings(bodies[first]):
        end = _fitted(bodies, observes, {first: start}, first)
        if not _fit(bodies, observes, end[1]):
            continue
        for k in others:
            turned = (replace(h, scale=end[1][first].scale) for h in all_headings(bodies[k]))
            joined = _least(_fitted(bodies, observes, {**end[1], k: h}, k) for h in turned)
            end = joined if _fit(bodies, observes, joined[1]) else end
        ends.append(end)
        if _settled(ends):
            break
    return min(ends, key=_rank, default=(float("inf"), {}))


def _fit(bodies: Sequence[FreeBody], observes: Sequence[Observe], to: Placed) -> bool:
    """Whether what is known of bodies, and what they share, is as near as a bundle may begin from."""
    off_m, near_m = list[Float](), list[float]()
    for k, place in to.items():
        observed = observes[k](place)
        places = given_places(observed, state_of(observed, bodies[k], place))
        off_m.append((places.observed_m - places.xyz)[places.given])
        off_m += [(X - Y).ravel() for _, _, X, Y in _shared(bodies, to, k)]
        near_m.append(FARTHEST_START * typical_distance(bodies[k], place))
    squares = np.concatenate(off_m) ** 2
    return float(squares.sum()) <= max(len(squares) - UNKNOWNS * len(to), 1) * float(np.mean(np.square(near_m)))


def _least(ends: Iterable[End]) -> End:
    """The end of least cost; no more are asked where several are the same."""
    done = list[End]()
    for end in ends:
        done.append(end)
        if _settled(done):
            break
    return min(done, key=_rank)


def _rank(end: End) -> tuple[int, float]:
    return -len(end[1]), end[0]


def _settled(ends: Sequence[End]) -> bool:
    most, least = min(_rank(end) for end in ends)
    return sum(_rank(end) <= (most, least + TOLERANCE) for end in ends) >= SAME_ENDS


def _fitted(bodies: Sequence[FreeBody], observes: Sequence[Observe], to: Placed, new: int) -> End:
    """All bodies adjusted; the new one begins with the shift and scale of what is observed of it."""
    of_new = observes[new](to[new])
    to = {**to, new: scaled(of_new, np.ones(sum(map(len, of_new)), dtype=bool), bodies[new], to[new])}
    observed = {k: _weighed(observes[k](to[k])) for k in to}
    v, J = _equations(bodies, observed, to)
    damping = DAMPING
    for _ in range(ITERATIONS):
        N, cost = J.T @ J, 0.5 * float(v @ v)
        step = -np.linalg.solve(N + damping * np.diag(np.diag(N) + RIDGE * (N.max() or 1.0)), J.T @ v)
        stepped = {k: retracted(s, np.asarray(dx)[None]) for (k, s), dx in zip(to.items(), step.reshape(-1, 7))}
        v_new, J_new = _equations(bodies, observed, stepped)
        gain = cost - 0.5 * float(v_new @ v_new)
        if gain >= 0.0:
            to, v, J, damping = stepped, v_new, J_new, max(damping / 10, SMALLEST_DAMPING)
            if gain < TOLERANCE**2:
                break
        elif (damping := 10 * damping) > LARGEST:
            break
    return 0.5 * float(v @ v), to


def _weighed(observed: Sequence[Observed]) -> Sequence[Observed]:
    return weighed(observed, np.ones(sum(map(len, observed)), dtype=bool))


def _equations(
    bodies: Sequence[FreeBody], observed: Mapping[int, Sequence[Observed]], to: Placed
) -> tuple[Float, Float]:
    """Whitened residuals (n,) and derivatives (n, 7 k), bodies side by side."""
    v, J = list[Float](), list[Float]()
    column = {k: slice(7 * n, 7 * n + 7) for n, k in enumerate(to)}

    def add(residuals: Float, derivatives: Mapping[int, Float]) -> None:
        rows = np.zeros((residuals.size, 7 * len(to)))
        for k, by_body in derivatives.items():
            rows[:, column[k]] = by_body.reshape(-1, 7)
        v.append(residuals.ravel())
        J.append(rows)

    for k, place in to.items():
        w, by_body = _of_one(bodies[k], observed[k], place)
        add(w, {k: by_body})
        for other, both, X, Y in _shared(bodies, to, k):
            traces = [to[j].scale ** 2 * np.einsum("nii->n", bodies[j].covariance[both]) for j in (k, other)]
            weight = 1.0 / np.sqrt(np.sum(traces, axis=0) / 3)
            by_bodies = {k: motions(X) * weight[:, None, None], other: -motions(Y) * weight[:, None, None]}
            add((X - Y) * weight[:, None], by_bodies)
    return np.concatenate(v), np.concatenate(J)


def _shared(bodies: Sequence[FreeBody], to: Placed, k: int) -> Iterator[tuple[int, Int, Float, Float]]:
    """Of each body before: its number, the points that body k shares with it, and where they lie by k and by it."""
    for other in [other for other in to if other < k]:
        both = np.flatnonzero(bodies[k].has[POINT] & bodies[other].has[POINT])
        if len(both):
            yield other, both, transform(to[k], bodies[k].xyz[both]), transform(to[other], bodies[other].xyz[both])


def _of_one(body: FreeBody, observed: Sequence[Observed], to: Similarity) -> tuple[Float, Float]:
    """Whitened residuals (n,) and derivatives (n, 7) of what is observed of a body, its own unknowns eliminated."""
    state = {BODY: to, **{name: value for o in observed for name, value in o.start.items()}}
    own = {u.name: u.free for o in observed for u in o.unknowns}
    width = {BODY: 7, **{name: int(free.sum()) for name, free in own.items()}}
    v, design = [np.zeros(0)], [np.zeros((0, sum(width.values())))]
    for o in observed:
        records = of_body(o.records, body)
        w, jacobians = whitened(records, state, np.arange(len(o)))
        by_group = {name: np.zeros((w.size, columns)) for name, columns in width.items()}
        for (group, block), derivative in zip(records.touches, jacobians):
            free = own.get(group, np.ones((1, 7), dtype=bool))
            table = np.zeros((*w.shape, *free.shape))
            table[np.arange(len(o)), :, block] = derivative
            by_group[group] = table.reshape(w.size, -1)[:, free.ravel()]
        v.append(w.ravel())
        design.append(np.hstack([*by_group.values()]))
    residuals, J = np.concatenate(v), np.concatenate(design)
    U, size, _ = np.linalg.svd(J[:, 7:], full_matrices=False)
    U = U[:, size > RIDGE * size.max(initial=0.0)]
    return residuals - U @ (U.T @ residuals), J[:, :7] - U @ (U.T @ J[:, :7])


def _determined(bodies: Sequence[FreeBody], observes: Sequence[Observe], to: Placed) -> Placed:
    """Those that no open motion moves."""
    places = [transform(s, bodies[k].places) for k, s in to.items()]
    extent = max(float(np.linalg.norm(np.ptp(X, axis=0))) for X in places)
    G = [motions(X) for X in places]
    M = block_diag(*(np.mean(g.swapaxes(1, 2) @ g, axis=0) for g in G))
    J = _equations(bodies, {k: _weighed(observes[k](s)) for k, s in to.items()}, to)[1]
    values, z = eigh(J.T @ J, M + RIDGE * np.trace(M) / len(M) * np.eye(len(M)))
    open_z = z[:, values * (UNKNOWN_MOTION * extent) ** 2 < 1.0].reshape(len(to), 7, -1)
    moved = [np.linalg.norm(g @ z_k, axis=1).max(initial=0.0) for g, z_k in zip(G, open_z)]
    return {k: s for (k, s), by in zip(to.items(), moved) if by < MOVED_SHARE}
