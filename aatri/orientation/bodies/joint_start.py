"""Bodies that only together are determined: by what is observed of each, and by the points that they share.

    X_k(p) - X_l(p) = 0,    X_k = T_k + s_k R_k x_k,    weighed by the variances of p in both bodies

beside the observations of each body, whose own unknowns are eliminated body by body. All similarities are adjusted at
once (Levenberg-Marquardt). One body after the other joins those that have begun, levelled and turned through all
headings, if it fits these; of all headings of the first the end of most bodies and least cost counts. With N = J'J of the whitened derivatives and M_k
the mean of G'G over the places of body k, whose motions are dX = G z_k, the solutions of

    N z = lambda M z

move the bodies by 1 (RMS) with a standard deviation of 1 / sqrt(lambda): bodies that move by what is known worse than
to `UNKNOWN` of their extent are not determined.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag, eigh

from aatri.adjustment.records import whitened
from aatri.arrays import Float
from aatri.geometry.similarity import IDENTITY, Similarity, motions, transform
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT
from aatri.observations.ties import BODY
from aatri.orientation.bodies.common_datum import RIDGE
from aatri.orientation.bodies.datum_start import (
    ITERATIONS,
    SAME_ENDS,
    TOLERANCE,
    Observe,
    all_headings,
    of_body,
    retracted,
    scaled,
    weighed,
)
from aatri.orientation.bodies.free_body import FreeBody

UNKNOWN = 0.1
"""Standard deviation of a motion of bodies, as a share of their extent, beyond which it is not determined."""

DAMPING, LARGEST = 1e-3, 1e8
"""Of the first step, as a share of the diagonal, and beyond which no step reduces the cost."""

MOVES = 0.1
"""Share of an open motion above which it moves a body."""

Placed = Mapping[int, Similarity]
End = tuple[float, Placed]
"""Half the sum of squares, and where it is reached."""


def joint_start(bodies: Sequence[FreeBody], observes: Sequence[Observe]) -> tuple[list[int], Placed]:
    """Numbers of bodies that share points, and ground from body of those that are determined together.

    Parameters
    ----------
    observes : sequence of callable
        Of each body, where it lies -> the observations that concern it.
    """
    first, *others = order = _order(bodies, observes)
    ends = list[End]()
    for start in all_headings(bodies[first]):
        end = _fitted(bodies, observes, {first: start}, first)
        for k in others:
            turned = (replace(h, scale=end[1][first].scale) for h in all_headings(bodies[k]))
            end = _least(_fitted(bodies, observes, {**end[1], k: h}, k) for h in turned)
        ends.append(end)
        if _settled(ends):
            break
    return order, _determined(bodies, observes, _least(ends)[1])


def _order(bodies: Sequence[FreeBody], observes: Sequence[Observe]) -> list[int]:
    """Bodies that hang together by points: that of most observations, then the one that shares most with these."""
    known, left = [body.has[POINT] for body in bodies], list(range(len(bodies)))
    order = [max(left, key=lambda k: sum(len(o) for o in observes[k](IDENTITY)))]
    while left := [k for k in left if k not in order]:
        shared = [sum(int((known[k] & known[other]).sum()) for other in order) for k in left]
        if not max(shared):
            break
        order.append(left[int(np.argmax(shared))])
    return order


def _least(ends: Iterable[End]) -> End:
    """The end of least cost; no more are asked where several are the same."""
    done = list[End]()
    for end in ends:
        done.append(end)
        if _settled(done):
            break
    return min(done, key=lambda end: end[0])


def _settled(ends: Sequence[End]) -> bool:
    least = min(cost for cost, _ in ends)
    return sum(cost <= least + TOLERANCE for cost, _ in ends) >= SAME_ENDS


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
            to, v, J, damping = stepped, v_new, J_new, damping / 10
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
        for other in [other for other in to if other < k]:
            both = np.flatnonzero(bodies[k].has[POINT] & bodies[other].has[POINT])
            X, Y = (transform(to[j], bodies[j].xyz[both]) for j in (k, other))
            traces = [to[j].scale ** 2 * np.einsum("nii->n", bodies[j].covariance[both]) for j in (k, other)]
            weight = 1.0 / np.sqrt(np.sum(traces, axis=0) / 3)
            by_bodies = {k: motions(X) * weight[:, None, None], other: -motions(Y) * weight[:, None, None]}
            add((X - Y) * weight[:, None], by_bodies)
    return np.concatenate(v), np.concatenate(J)


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
    open_z = z[:, values * (UNKNOWN * extent) ** 2 < 1.0].reshape(len(to), 7, -1)
    moved = [np.linalg.norm(g @ z_k, axis=1).max(initial=0.0) for g, z_k in zip(G, open_z)]
    return {k: s for (k, s), by in zip(to.items(), moved) if by < MOVES}
