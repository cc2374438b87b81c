"""Control that is wrong in a way which spoils the start of a body: two numbers exchanged, an axis mirrored.

A similarity of all that is known in full, control and positions, is fitted as given, and with each two control points
exchanged. Two are exchanged if that leaves less than `EXCHANGE_LEAVES` of the sum of distances, and no other two leave
less than `SECOND_LEAVES` times as much. Points in a plane may fit mirrored, too: what makes the images look upwards is
none. They do not take part in the start, and are held against the orientation by the others.

Where few points are known in full the others, distances, attitudes, positions that drift ... tell too
(`exchanged_by_all`): all that is observed is adjusted as given, and with each two control points exchanged, and sums of
squares are compared likewise.

Control is mirrored where it fits much better so, or where by it the images look upwards (`refuse_mirrored`).
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from aatri.adjusting.added_variance import observed_components
from aatri.adjustment.statistics.limits import MAX_SIGMA0, MOST_FOR_EXCHANGE
from aatri.arrays import Bool, Float, Int
from aatri.errors import ConvergenceError, GeometryError
from aatri.geometry.similarity import Similarity, closed_form, robust_closed_form, transform
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
from aatri.orientation.bodies.limits import (
    CLEARLY_UPWARDS,
    EXCHANGE_LEAVES,
    FEWEST_FOR_EXCHANGE,
    FEWEST_MIRRORED,
    FLAT_CONTROL,
    MIRRORED_CLEARLY,
    MOST_BY_ALL,
    MOST_SEARCHED,
    SECOND_LEAVES,
    SPARE_FOR_EXCHANGE,
    TRIANGLE,
    UPWARDS,
)

FEW_ITERATIONS, BESIDE = 10, 40
"""An exchange that explains all ends after two or three iterations, what does not leaves far more; positions that are
fitted beside the control: so many, evenly taken, show which two are exchanged."""


def exchanged_of(places: GivenPlaces, up: Float | None, fewest: int = FEWEST_FOR_EXCHANGE) -> Int:
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
    x: Float, X: Float, n_control: int | None = None, fewest: int = FEWEST_FOR_EXCHANGE, up: Float | None = None
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
    if not 2 <= control <= MOST_FOR_EXCHANGE or len(x) < fewest or not np.ptp(x, axis=0).any():
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
    if left[0][0] < EXCHANGE_LEAVES * misfit(as_given) and second > SECOND_LEAVES * left[0][0]:
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
    if not 2 <= len(control) <= MOST_BY_ALL or redundancy < SPARE_FOR_EXCHANGE:
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
    if np.isfinite(of_positions):
        of_all = cost(body, use, ITERATIONS)
        if of_positions >= EXCHANGE_LEAVES * of_all:  # whichever is exchanged
            return none
    pairs = list(combinations(control.tolist(), 2))
    costs = [exchanged(a, b, FEW_ITERATIONS) for a, b in pairs]
    k = int(np.argmin(costs))
    best, as_given = costs[k], cost(body, without_rays(*pairs[k]), ITERATIONS)
    if not best < EXCHANGE_LEAVES * as_given:
        return none
    if 2.0 * best > MAX_SIGMA0**2 * redundancy:  # no fit, only less bad: the others are followed to their ends
        costs = [exchanged(a, b, ITERATIONS) for a, b in pairs]
    second = np.partition(costs, 1)[1] if len(costs) > 1 else np.inf
    return np.array(pairs[k]) if second > SECOND_LEAVES**2 * best else none


class MirroredError(GeometryError):
    """The axes of the control or of the images are mirrored, which is so of all of a block."""


def refuse_mirrored(places: GivenPlaces, used: Bool, to: Similarity, up: Float | None, what: str) -> None:
    """Raise if control or images must be mirrored.

    Parameters
    ----------
    used : (n,) bool
        Those that are not rejected.
    to : Similarity
        Ground from body.
    up : (3,) float64, optional
        Direction against the mean viewing direction, in the body; None where it may be any, as attitudes say.

    Raises
    ------
    MirroredError
        Or a GeometryError that names two points with each other's number, where these explain it.
    """
    kept = places.take(used)
    reason = _mirrored(kept, to, up) or _fits_as_a_whole_mirrored(places)
    if not reason:
        return
    two = places.name[exchanged_of(places, None if up is None else to.rotation @ up, 3)].tolist()
    if two:
        text = f"{what}: {reason}, unless {' and '.join(two)} have each other's number"
        raise GeometryError(text, remedy="exchange the two numbers in the control, or leave both out")
    remedy = "declare the axes of the control in their true order, [north, east, up] or [east, north, up]"
    if kept.given.all(axis=1).sum() < FEWEST_MIRRORED:
        remedy += "; check which control point has which number: so few look alike mirrored and with two exchanged"
    if not (kept.kind == CONTROL).any():
        remedy = "check which image each id and each position belongs to, and the axes of the positions"
    raise MirroredError(f"{what}: {reason}", remedy=f"{remedy}; check the y axis of the image coordinates (pixel: y)")


def _fits_as_a_whole_mirrored(places: GivenPlaces) -> str:
    """That all control fits mirrored, rejected points too: of four any three fit turned over, against the fourth."""
    full = places.take(np.flatnonzero(places.given.all(axis=1) & (places.kind == CONTROL)))
    if len(full.row) <= TRIANGLE:
        return ""
    as_it_is, other = (_misfits_m(full, full.observed_m * [1, 1, sign])[1] for sign in (1, -1))
    fits_m = FLAT_CONTROL * float(np.linalg.norm(np.ptp(full.observed_m, axis=0)))
    return "control fits it mirrored only" if other < fits_m < MIRRORED_CLEARLY * as_it_is else ""


def _mirrored(kept: GivenPlaces, to: Similarity, up: Float | None) -> str:
    """Why control or images must be mirrored: control fits much better mirrored, or the images look upwards.

    Images of facades, or of what stands above them, may look upwards rightly. Points in a plane fit as well when they
    are mirrored; of these it counts how steeply the images look upwards.
    """
    steep = 0.0 if up is None else -float((to.rotation @ up)[2]) / float(np.linalg.norm(up))
    if (kept.kind == CONTROL).any():
        text = "oriented by its control the images look upwards, so the control is mirrored"
    else:
        text = "oriented by positions alone the images look upwards, so images have each other's id or position, or "
        text += "the axes of the positions are mirrored"
    full = kept.take(np.flatnonzero(kept.given.all(axis=1)))
    if len(full.row) >= FEWEST_MIRRORED:
        as_it_is, other = (_misfits_m(full, full.observed_m * [1, 1, sign]) for sign in (1, -1))
        extent_m = float(np.linalg.norm(np.ptp(full.observed_m, axis=0)))
        if ((other < MIRRORED_CLEARLY * as_it_is) & (as_it_is > FLAT_CONTROL * extent_m)).any():
            return text if steep > CLEARLY_UPWARDS else "control and positions fit it mirrored only"
        if as_it_is[0] < MIRRORED_CLEARLY * other[0]:
            return ""
    return text if steep > UPWARDS else ""


def _misfits_m(places: GivenPlaces, X: Float) -> Float:
    """Largest median misfit of a kind, by a robust similarity; root mean square by one of least squares; (2,), m.

    Positions in a plane fit either way, whatever few control points do; so do most of five points.
    """
    off = robust_closed_form(places.xyz, X)[1]
    rms = np.sqrt(((transform(closed_form(places.xyz, X), places.xyz) - X) ** 2).sum(axis=1).mean())
    several = [k for k in np.unique(places.kind) if (places.kind == k).sum() > 1]  # one point alone may be wrong
    return np.array([max(float(np.median(off[places.kind == kind])) for kind in several), rms])
