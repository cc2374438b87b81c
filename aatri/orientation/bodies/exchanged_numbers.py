"""Two control points with each other's number, which would spoil the start of a body.

A similarity of all that is known in full, control and positions, is fitted as given, and with each two control points
exchanged. Two are exchanged if that leaves less than `EXPLAINED` of the sum of distances, and no other two leave less
than `SECOND` times as much. Points in a plane may fit mirrored, too: what makes the images look upwards is none. They
do not take part in the start, and are held against the orientation by the others.

Where few points are known in full the others, distances, attitudes, positions that drift ... tell too
(`exchanged_by_all`): all that is observed is adjusted as given, and with each two control points exchanged, and sums of
squares are compared likewise.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from aatri.adjusting.added_variance import observed_components
from aatri.adjustment.statistics.global_test import MAX_SIGMA0
from aatri.arrays import Bool, Float, Int
from aatri.errors import ConvergenceError, GeometryError
from aatri.geometry.similarity import Similarity, closed_form, transform
from aatri.observations.control import KIND as CONTROL
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT
from aatri.observations.positions import KIND as POSITION
from aatri.orientation.bodies.datum_analysis import GivenPlaces, given_places
from aatri.orientation.bodies.datum_start import (
    ITERATIONS,
    Observe,
    closed_start,
    fitted,
    looks_upwards,
    searched_start,
)
from aatri.orientation.bodies.free_body import FreeBody, state_of

EXPLAINED, SECOND = 0.1, 2.0

FEWEST, MOST = 5, 40
"""Points without which two cannot be told, three must be left; more than the latter are no matter of two numbers."""

MOST_BY_ALL, MOST_SEARCHED, SPARE = 12, 4, 4
"""Control points of which each two are tried by all observations, and where all headings are tried for each two; the
least redundancy, as two of three points alone would be exchanged by chance."""

FEW_ITERATIONS, BESIDE = 10, 40
"""An exchange that explains all ends after two or three iterations, what does not leaves far more; positions that are
fitted beside the control: so many, evenly taken, show which two are exchanged."""


def exchanged_of(places: GivenPlaces, up: Float | None, fewest: int = FEWEST) -> Int:
    """Two control points with each other's number, among places known in full; none otherwise.

    Parameters
    ----------
    up : (3,) float64, optional
        Direction against the mean viewing direction, in the axes of the places.
    """
    full = np.flatnonzero(places.given.all(axis=1) & np.isin(places.kind, [CONTROL, POSITION]))
    full = full[np.argsort(places.kind[full] != CONTROL, kind="stable")]
    n_control = int((places.kind[full] == CONTROL).sum())
    return full[exchanged_control(places.xyz[full], places.observed_m[full], n_control, fewest, up)]


def exchanged_control(
    x: Float, X: Float, n_control: int | None = None, fewest: int = FEWEST, up: Float | None = None
) -> Bool:
    """Which of some points are exchanged, (n,): two of them, or none.

    Parameters
    ----------
    x, X : (n, 3) float64
        In the component, and on the ground, m.
    n_control : int, optional
        The first points are control, the others positions, whose numbers nobody exchanges; default: all are control.
    fewest : int
        Of all points.
    up : (3,) float64, optional
        See `exchanged_of`.
    """
    exchanged = np.zeros(len(x), dtype=bool)
    control = len(x) if n_control is None else n_control
    if not 2 <= control <= MOST or len(x) < fewest or not np.ptp(x, axis=0).any():
        return exchanged
    step = max(1, (len(x) - control) // BESIDE)
    sample = np.append(np.arange(control), np.arange(control, len(x), step))
    x, X = x[sample], X[sample]

    def misfit(order: list[int]) -> float:
        to = closed_form(x, X[order])
        if up is not None and order != as_given and looks_upwards(to, up):
            return float("inf")
        return float(np.linalg.norm(transform(to, x) - X[order], axis=1).sum())

    as_given = list(range(len(x)))
    left = []
    for a, b in combinations(range(control), 2):
        order = as_given.copy()
        order[a], order[b] = b, a
        left.append((misfit(order), a, b))
    left.sort()
    second = left[1][0] if len(left) > 1 else np.inf
    if left[0][0] < EXPLAINED * misfit(as_given) and second > SECOND * left[0][0]:
        exchanged[list(left[0][1:])] = True
    return exchanged


def exchanged_by_all(
    observed: Sequence[Observed], observe: Observe, body: FreeBody, use: Bool, level: Similarity
) -> Int:
    """Two control points with each other's number, by all that is observed: their rows, kind by kind, or none.

    Parameters
    ----------
    use : (n,) bool
        Observations that count, kind by kind.
    level : Similarity
        The levelled body.
    """
    none: Int = np.zeros(0, dtype=np.int64)
    of_kinds = ([o.kind for o in observed], [o.exact or o.holds is not None for o in observed])
    kind, exact = (np.repeat(values, [*map(len, observed)]) for values in of_kinds)
    control = np.flatnonzero((rows := kind == CONTROL) & use)
    point = np.concatenate([none, *(dict(o.records.touches).get(POINT, np.full(len(o), -1)) for o in observed)])
    components = np.concatenate([none, *(observed_components(o).sum(axis=1) for o in observed)])
    own = sum(int(u.free.sum()) for o in observed for u in o.unknowns)
    redundancy = int(components[use].sum()) - own - 7
    if not 2 <= len(control) <= MOST_BY_ALL or redundancy < SPARE:
        return none

    def cost(of: FreeBody, use: Bool, iterations: int, *, searched: bool = len(control) <= MOST_SEARCHED) -> float:
        places = given_places(observed, state_of(observed, of, level))
        places = places.take(use[places.row])
        start = closed_start(places, places.xyz @ level.rotation)
        if start is not None:
            if of is not body and looks_upwards(start, body.up):
                return float("inf")
            return fitted(observe, of, use, start, iterations)
        try:
            return searched_start(observe, of, use)[1] if searched else float("inf")
        except (ConvergenceError, GeometryError):
            return float("inf")

    def without_rays(a: int, b: int) -> Bool:
        return np.asarray(use & ~(np.isin(point, point[[a, b]]) & ~rows))

    def exchanged(a: int, b: int, iterations: int) -> float:
        order = np.arange(len(body.xyz))
        order[[point[a], point[b]]] = point[[b, a]]
        ordered = replace(body, xyz=body.xyz[order], covariance=body.covariance[order])
        return cost(ordered, without_rays(a, b), iterations)

    of_positions = cost(body, use & (kind == POSITION) & ~exact, ITERATIONS, searched=False)
    if np.isfinite(of_positions) and of_positions >= EXPLAINED * cost(body, use, ITERATIONS):  # whichever is exchanged
        return none
    pairs = list(combinations(control.tolist(), 2))
    costs = [exchanged(a, b, FEW_ITERATIONS) for a, b in pairs]
    k = int(np.argmin(costs))
    best, as_given = costs[k], cost(body, without_rays(*pairs[k]), ITERATIONS)
    if not best < EXPLAINED * as_given:
        return none
    if 2.0 * best > MAX_SIGMA0**2 * redundancy:  # no fit, only less bad: the others are followed to their ends
        costs = [exchanged(a, b, ITERATIONS) for a, b in pairs]
    second = np.partition(costs, 1)[1] if len(costs) > 1 else np.inf
    return np.array(pairs[k]) if second > SECOND**2 * best else none
